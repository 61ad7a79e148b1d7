# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# The SPIR-V validator, which a test runs over every compiled shader: the machine's own, or one unpacked from the Debian packages
# that spirv-val-ARCH.lock pins. Sourced by ./run.
#
#   $MON3TR_CACHE/spirv-val/run    the wrapper: `run ARGS...` is `spirv-val ARGS...`

spirv_val_lock=$repo/scripts/spirv-val-$debian_arch.lock

# Raise this when what is unpacked, trimmed or written into the wrapper changes.
spirv_val_layout=1

spirv_val_pins() { echo "$(sha256sum <"$spirv_val_lock" | cut -d' ' -f1) layout $spirv_val_layout"; }

# spirv_val_is_there: something to point MON3TR_SPIRV_VAL at.
spirv_val_is_there() {
	[ -n "${MON3TR_SPIRV_VAL:-}" ] || command -v spirv-val >/dev/null || debs_are_ready "$MON3TR_CACHE/spirv-val" "$(spirv_val_pins)"
}

install_spirv_val() {
	local prefix=$MON3TR_CACHE/spirv-val new=$MON3TR_CACHE/spirv-val.new instead="" trust=signed
	say "Fetching spirv-val $(locked_version "$spirv_val_lock" spirv-tools) from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$spirv_val_lock" "$new"
	find "$new/root/usr/bin" -type f ! -name spirv-val -delete
	trim_documentation "$new"
	{
		cat <<WRAPPER
#!/bin/sh
# Written by ./run: the SPIR-V validator in the prefix this script lies in.
here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
lib=\$here/root/usr/lib/$deb_triplet
set -- "\$here/root/usr/bin/spirv-val" "\$@"
WRAPPER
		wrapper_tail "$spirv_val_lock"
	} >"$new/run"
	chmod +x "$new/run"
	put_in_place "$new" "$prefix" "$(spirv_val_pins)${instead:+, but $trust $instead}"
}

export_spirv_val() {
	if [ -n "${MON3TR_SPIRV_VAL:-}" ]; then return; fi
	MON3TR_SPIRV_VAL=$(command -v spirv-val) || MON3TR_SPIRV_VAL=$MON3TR_CACHE/spirv-val/run
	export MON3TR_SPIRV_VAL
}
