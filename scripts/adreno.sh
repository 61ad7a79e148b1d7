# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# A compiler for the Quest 3's GPU: Mesa's driver for Adreno, and the shim that pretends to be one, from the Debian
# packages that the adreno-*-amd64.lock pin. Shaders are compiled to the GPU's machine code; nothing is executed. Sourced by ./run.
#
#   $MON3TR_CACHE/adreno/run          `run PROGRAM ARGS...`: PROGRAM with that GPU as its only Vulkan device
#   $MON3TR_CACHE/adreno/root, libc   the packages' files
#   $MON3TR_CACHE/adreno/shim.so      the shim, pretending to be the Quest 3's variant

adreno_locks=("$repo/scripts/adreno-trixie-amd64.lock" "$repo/scripts/adreno-trixie-backports-amd64.lock")
adreno_shim=$repo/scripts/adreno-shim.py

# Raise this when what is unpacked, trimmed or written into the wrapper changes.
adreno_pins() { echo "$(cat "${adreno_locks[@]}" "$adreno_shim" | sha256sum | cut -d' ' -f1) layout 2"; }

adreno_version() { locked_version "${adreno_locks[1]}" mesa-vulkan-drivers; }

adreno_is_there() { [ -n "${MON3TR_ADRENO:-}" ] || debs_are_ready "$MON3TR_CACHE/adreno" "$(adreno_pins)"; }

# adreno_lacks: prints why it cannot be set up here; fails if it can.
adreno_lacks() {
	if [ "$debian_arch" != amd64 ]; then
		echo "the compiler for the Quest 3's GPU is set up for x86-64 alone, and this machine is $(uname -m)"
	elif ! command -v dpkg-deb >/dev/null; then
		echo "dpkg-deb, which unpacks Debian packages, is missing: install dpkg"
	else
		return 1
	fi
}

install_adreno() {
	local prefix=$MON3TR_CACHE/adreno new=$MON3TR_CACHE/adreno.new instead="" trust=signed lock lib=root/usr/lib/$deb_triplet
	say "Fetching Mesa $(adreno_version)'s Adreno driver from $debian_mirror"
	rm -rf "$new"
	for lock in "${adreno_locks[@]}"; do unpack_lock "$lock" "$new"; done
	find "$new/$lib" \( -name 'libvulkan_*.so' ! -name libvulkan_freedreno.so -o -name 'lib*_noop_drm_shim.so' ! -name 'libfreedreno*' \) -delete
	rm -rf "$new/root/usr/bin" "$new/$lib"/libVkLayer_* "$new/root/usr/share/vulkan/implicit_layer.d" "$new/root/usr/share/vulkan/explicit_layer.d"
	trim_documentation "$new"
	python3 "$adreno_shim" "$new/$lib/libfreedreno_noop_drm_shim.so" "$new/shim.so" ||
		die "the shim of this Mesa cannot be made a Quest 3's: see scripts/adreno-shim.py"
	cat >"$new/run" <<WRAPPER
#!/bin/bash
# Written by ./run: a program with the Quest 3's GPU, as Mesa's compiler knows it, as its only Vulkan device.
here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
libc=\$here/libc/usr/lib/$deb_triplet
lib=\$here/$lib
# The number of the chip, as newer shims look it up, and of the model, as older ones do: the patched row has both.
export FD_CHIP_ID=0x43050b00 FD_GPU_ID=0
export VK_DRIVER_FILES=\$here/root/usr/share/vulkan/icd.d/freedreno_icd.json
export VK_ICD_FILENAMES=\$VK_DRIVER_FILES VK_LOADER_LAYERS_DISABLE='*' MESA_SHADER_CACHE_DISABLE=true
# The shim prints every call of the driver that it does not implement.
exec "\$libc/$dynamic_linker" --library-path "\$libc:\$lib" --preload "\$here/shim.so" "\$@" 2> >(grep -v '^Unknown DRM_IOCTL_MSM_' >&2)
WRAPPER
	chmod +x "$new/run"
	put_in_place "$new" "$prefix" "$(adreno_pins)${instead:+, but $trust $instead}"
}

export_adreno() { export MON3TR_ADRENO=${MON3TR_ADRENO:-$MON3TR_CACHE/adreno}; }
