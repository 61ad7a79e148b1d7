# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# Mesa's lavapipe (Vulkan on the CPU) in a private prefix, unpacked from the Debian packages that lavapipe-ARCH.lock pins:
# no root, nothing outside the cache. Sourced by ./run; whether it is needed at all, prepare.sh decides.
#
#   $MON3TR_CACHE/lavapipe/run    the wrapper: `run PROGRAM ARGS...` runs PROGRAM so that the prefix's libraries load

lavapipe_lock=$repo/scripts/lavapipe-$debian_arch.lock

# Raise this when what is unpacked, trimmed or written into the wrapper changes.
lavapipe_layout=2

lavapipe_pins() { lock_pins "$lavapipe_lock" "$lavapipe_layout"; }

# lavapipe_version: the locked Mesa, for messages
lavapipe_version() { locked_version "$lavapipe_lock" mesa-vulkan-drivers; }

# lavapipe_environment ROOT: a line NAME=VALUE for all that leads a program to lavapipe in the prefix's ROOT, and keeps the machine's
# own Vulkan out of it. Built for other libraries, a driver or layer of the machine's may crash the program; so each path here takes
# the place of all where Vulkan's loader would look, and what would add to one (VK_ADD_...) then counts no more.
lavapipe_environment() {
	local vulkan=$1/usr/share/vulkan
	cat <<-LINES
		VK_DRIVER_FILES=$vulkan/icd.d/lvp_icd.json
		VK_ICD_FILENAMES=$vulkan/icd.d/lvp_icd.json
		VK_LAYER_PATH=$vulkan/explicit_layer.d
		VK_IMPLICIT_LAYER_PATH=$vulkan/implicit_layer.d
		VK_LAYER_SETTINGS_PATH=$vulkan/settings.d
		XKB_CONFIG_ROOT=$1/usr/share/X11/xkb
	LINES
}

# lavapipe_exports ROOT: the same for a wrapper, whose caller may have set some; ROOT is the wrapper's own word for the folder.
lavapipe_exports() { lavapipe_environment "$1" | sed 's/^\([A-Z_]*\)=\(.*\)$/export \1="${\1-\2}"/'; }

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
WRAPPER
	# shellcheck disable=SC2016 # the wrapper knows where it lies
	lavapipe_exports '$here/root' >>"$prefix/run"
	wrapper_tail "$lavapipe_lock" >>"$prefix/run"
	chmod +x "$prefix/run"
}

install_lavapipe() {
	local prefix=$MON3TR_CACHE/lavapipe new=$MON3TR_CACHE/lavapipe.new instead="" trust=signed
	say "Fetching lavapipe $(lavapipe_version) from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$lavapipe_lock" "$new"
	trim_lavapipe "$new"
	hide_settings_from_lavapipe "$new"
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
	# Where the environment has the loader look for them: there are none.
	mkdir -p "$share/vulkan/implicit_layer.d" "$share/vulkan/settings.d"
	rm -rf "$1/root/usr/bin"
	trim_documentation "$1"
}

# Vulkan's loader and the validation layer read settings of the user's and of the machine's (Vulkan's configurator leaves them), which
# may load any layer. No variable keeps them from that: the name they look for is changed to one that no file has.
hide_settings_from_lavapipe() {
	python3 - "$1/root/usr/lib/$deb_triplet" <<-'PY' || die "Debian's Vulkan loader is not what scripts/lavapipe.sh knows"
		import pathlib, sys
		for library, name in [("libvulkan.so.1", b"/vk_loader_settings.js"), ("libVkLayer_khronos_validation.so", b"/vulkan/settings.d/vk_layer_settings.txt")]:
		    path = pathlib.Path(sys.argv[1], library).resolve()
		    data = path.read_bytes()
		    if name not in data:
		        sys.exit(f"{name.decode()} does not stand in {path}")
		    path.write_bytes(data.replace(name, name.replace(b"/vk_", b"/no_")))
	PY
}
