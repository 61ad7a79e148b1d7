# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# The sound server PulseAudio, which tests start with devices that play and record nothing: the machine's own, or one unpacked from the
# Debian packages that pulseaudio-ARCH.lock pins. Nothing is started here. Sourced by ./run.

pulseaudio_lock=$repo/scripts/pulseaudio-$debian_arch.lock

pulseaudio_pins() { lock_pins "$pulseaudio_lock" 1; }

pulseaudio_is_there() { program_is_there MON3TR_PULSEAUDIO pulseaudio "$(pulseaudio_pins)"; }

install_pulseaudio() {
	local prefix=$MON3TR_CACHE/pulseaudio new=$MON3TR_CACHE/pulseaudio.new instead="" trust=signed modules
	say "Fetching pulseaudio $(locked_version "$pulseaudio_lock" pulseaudio) from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$pulseaudio_lock" "$new"
	modules=$(cd "$new" && echo root/usr/lib/"$deb_triplet"/pulse-*/modules)
	[ -d "$new/$modules" ] || modules=$(cd "$new" && echo root/usr/lib/pulse-*/modules)
	[ -e "$new/$modules/module-null-sink.so" ] || die "Debian's package of PulseAudio has its modules elsewhere now: scripts/pulseaudio.sh has to follow it"
	find "$new/root/usr/bin" -type f ! -name pulseaudio -delete
	# Devices of its own, which need libraries that are not here, and the desktop's services.
	rm -rf "${new:?}/root/etc" "$new/root/usr/lib/systemd" "$new/root/usr/share/alsa" "$new/root/usr/share/zsh"
	trim_documentation "$new"
	{
		cat <<-WRAPPER
			#!/bin/sh
			# Written by ./run: pulseaudio in the prefix this script lies in.
			here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
			lib=\$here/root/usr/lib/$deb_triplet
			lib=\$lib:\$lib/pulseaudio:\$here/$modules
			# Without, it would start itself again by the name of what runs: the dynamic linker's, where that is ours.
			export LD_BIND_NOW=1
			set -- "\$here/root/usr/bin/pulseaudio" --dl-search-path="\$here/$modules" "\$@"
		WRAPPER
		wrapper_tail "$pulseaudio_lock"
	} >"$new/run"
	chmod +x "$new/run"
	put_in_place "$new" "$prefix" "$(pulseaudio_pins)${instead:+, but $trust $instead}"
}

export_pulseaudio() { export_program MON3TR_PULSEAUDIO pulseaudio; }
