# shellcheck shell=bash disable=SC2154,SC2034 # run and prepare.sh set what is not assigned here; unpack_lock sets instead and trust
# libfaketime, by which a test sets the clock of one program: unpacked from the Debian package that faketime-ARCH.lock pins. Sourced
# by ./run.

faketime_lock=$repo/scripts/faketime-$debian_arch.lock

faketime_pins() { lock_pins "$faketime_lock" 1; }

faketime_is_there() { [ -n "${MON3TR_FAKETIME:-}" ] || debs_are_ready "$MON3TR_CACHE/faketime" "$(faketime_pins)"; }

install_faketime() {
	local new=$MON3TR_CACHE/faketime.new instead="" trust=signed
	say "Fetching libfaketime $(locked_version "$faketime_lock" libfaketime) from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$faketime_lock" "$new"
	trim_documentation "$new"
	put_in_place "$new" "$MON3TR_CACHE/faketime" "$(faketime_pins)${instead:+, but $trust $instead}"
}

export_faketime() {
	export MON3TR_FAKETIME=${MON3TR_FAKETIME:-$MON3TR_CACHE/faketime/root/usr/lib/$deb_triplet/faketime/libfaketime.so.1}
}
