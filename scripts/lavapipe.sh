# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# Mesa's lavapipe (Vulkan on the CPU) in a private prefix, unpacked from the Debian packages that lavapipe-ARCH.lock pins:
# no root, nothing outside the cache. Sourced by ./run; whether it is needed at all, prepare.sh decides.
#
#   $MON3TR_CACHE/lavapipe/run    the wrapper: `run PROGRAM ARGS...` runs PROGRAM so that the prefix's libraries load

lavapipe_lock=$repo/scripts/lavapipe-$debian_arch.lock

# Raise this when what is unpacked, trimmed or written into the wrapper changes.
lavapipe_layout=1

lavapipe_pins() { lock_pins "$lavapipe_lock" "$lavapipe_layout"; }

# lavapipe_version: the locked Mesa, for messages
lavapipe_version() { locked_version "$lavapipe_lock" mesa-vulkan-drivers; }

write_lavapipe_wrapper() {
	local prefix=$1 libc_version
	libc_version=$(locked_version "$lavapipe_lock" libc6)
	cat >"$prefix/run" <<WRAPPER
#!/bin/sh
# Written by ./run: runs a program so that it finds the lavapipe prefix this script lies in.
#
#   run PROGRAM ARGS...    PROGRAM with a path, not looked up in PATH
#
# The driver needs glibc $libc_version. Where the machine's own is older, the program runs on the prefix's: through its dynamic
# linker, so /proc/self/exe is that linker, and children run on the machine's libc as ever unless they are wrapped too.
# Cargo runs programs and tests through this (CARGO_TARGET_..._RUNNER); a test that starts a program of ours puts
# \$MON3TR_RUNNER before it when that is set. The Vulkan variables are set only where the caller has not set them.
here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
lib=\$here/root/usr/lib/$deb_triplet
export VK_DRIVER_FILES="\${VK_DRIVER_FILES-\$here/root/usr/share/vulkan/icd.d/lvp_icd.json}"
export VK_ICD_FILENAMES="\${VK_ICD_FILENAMES-\$VK_DRIVER_FILES}"
export VK_LAYER_PATH="\${VK_LAYER_PATH-\$here/root/usr/share/vulkan/explicit_layer.d}"
export XKB_CONFIG_ROOT="\${XKB_CONFIG_ROOT-\$here/root/usr/share/X11/xkb}"
WRAPPER
	wrapper_tail "$lavapipe_lock" >>"$prefix/run"
	chmod +x "$prefix/run"
}

install_lavapipe() {
	local prefix=$MON3TR_CACHE/lavapipe new=$MON3TR_CACHE/lavapipe.new instead="" trust=signed
	say "Fetching lavapipe $(lavapipe_version) from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$lavapipe_lock" "$new"
	trim_lavapipe "$new"
	write_lavapipe_wrapper "$new"
	put_in_place "$new" "$prefix" "$(lavapipe_pins)${instead:+, but $trust $instead}"
}

# Of 300 MB unpacked, what no program opens: other drivers and layers, documentation, character sets.
trim_lavapipe() {
	local lib=$1/root/usr/lib/$deb_triplet share=$1/root/usr/share
	find "$lib" -name 'libvulkan_*.so' ! -name libvulkan_lvp.so -delete
	find "$share/vulkan/icd.d" -name '*.json' ! -name lvp_icd.json -delete
	find "$share/vulkan/explicit_layer.d" -name '*.json' ! -name VkLayer_khronos_validation.json -delete
	rm -rf "$share/vulkan/implicit_layer.d" "$lib"/libVkLayer_INTEL_* "$lib"/libVkLayer_MESA_*
	rm -rf "$1/root/usr/bin"
	trim_documentation "$1"
}
