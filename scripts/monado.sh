# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# Monado, an OpenXR runtime, with OpenXR's loader and an X server without a screen for its window: in a private prefix, unpacked
# from the Debian packages that monado-ARCH.lock pins. It needs a Vulkan, the machine's own or lavapipe's prefix, and brings none.
# Nothing is started here. Sourced by ./run.
#
#   $MON3TR_CACHE/monado/run                     the wrapper: `run ARGS...` is monado-service with ARGS, under the same process id
#   $MON3TR_CACHE/monado/openxr_monado.json      the runtime's manifest, for XR_RUNTIME_JSON
#   $MON3TR_CACHE/monado/libopenxr_loader.so.1   OpenXR's loader, opened by this path and on no library path
#   $MON3TR_CACHE/monado/with                    `with PROGRAM ARGS...` runs PROGRAM so that it can open the loader and the runtime
#   $MON3TR_CACHE/monado/xvfb                    `xvfb ARGS...` is Xvfb with ARGS, under the same process id

monado_lock=$repo/scripts/monado-$debian_arch.lock

# Raise this when what is unpacked, trimmed or written into the wrappers changes.
monado_pins() { lock_pins "$monado_lock" 2; }

monado_version() { locked_version "$monado_lock" monado-service; }

monado_is_there() { [ -n "${MON3TR_MONADO:-}" ] || debs_are_ready "$MON3TR_CACHE/monado" "$(monado_pins)"; }

# xr_needs_monado: whether a display on OpenXR needs the prefix: not where a runtime is active and a loader finds it.
xr_needs_monado() {
	! openxr_is_active || ! python3 -c 'import ctypes; ctypes.CDLL("libopenxr_loader.so.1")' 2>/dev/null
}

# openxr_is_active: where the loader looks for the machine's runtime, in its order.
openxr_is_active() {
	local folders=() one
	if [ -n "${XR_RUNTIME_JSON:-}" ]; then return 0; fi
	IFS=: read -r -a folders <<<"${XDG_CONFIG_HOME:-${HOME:-/nonexistent}/.config}:${XDG_CONFIG_DIRS:-/etc/xdg}:/usr/local/etc:/etc:/usr/local/share:/usr/share"
	for one in "${folders[@]}"; do
		if [ -e "$one/openxr/1/active_runtime.json" ] || [ -e "$one/openxr/1/active_runtime.$(uname -m).json" ]; then return 0; fi
	done
	return 1
}

install_monado() {
	local prefix=$MON3TR_CACHE/monado new=$MON3TR_CACHE/monado.new instead="" trust=signed
	say "Fetching Monado $(monado_version) from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$monado_lock" "$new"
	trim_monado "$new"
	add_monado_stand_in "$new"
	add_monado_client "$new"
	write_monado_wrapper "$new" run "monado-service" <<-'WRAPPER'
		lib=$all
		set -- "$here/root/usr/bin/monado-service" "$@"
	WRAPPER
	write_monado_wrapper "$new" with "a program, so that it can open OpenXR's loader and the runtime" <<-'WRAPPER'
		lib=$here/lib
	WRAPPER
	write_monado_wrapper "$new" xvfb "Xvfb, an X server without a screen" <<-'WRAPPER'
		lib=$all
		# Xvfb starts xkbcomp from the folder it runs in.
		cd "$here/xkb" || exit 1
		set -- "$here/root/usr/bin/Xvfb" "$@" -xkbdir "$here/root/usr/share/X11/xkb" -extension GLX
	WRAPPER
	mkdir "$new/xkb"
	write_monado_wrapper "$new" xkb/xkbcomp "xkbcomp" <<-'WRAPPER'
		here=${here%/*}
		lib=$here/root/usr/lib/TRIPLET
		set -- "$here/root/usr/bin/xkbcomp" "$@"
	WRAPPER
	put_in_place "$new" "$prefix" "$(monado_pins)${instead:+, but $trust $instead}"
}

# Documentation, and programs and data that none of ours opens. Vulkan's loader is the one that belongs to the Vulkan used. The C++
# library goes to the C library: where the machine's own is as new, its drivers may need a newer one.
trim_monado() {
	local root=$1/root lib=$1/root/usr/lib/$deb_triplet
	mv "$lib"/libstdc++.so.* "$lib"/libgcc_s.so.* "$1/libc/usr/lib/$deb_triplet/"
	find "$root/usr/bin" -type f ! -name monado-service ! -name Xvfb ! -name xkbcomp -delete
	rm -rf "$lib"/libvulkan.so.* "${root:?}/etc" "${root:?}/var" "$root/usr/lib/systemd" "$root/usr/lib/udev" "$root/usr/share/alsa" "$root/usr/share/X11/locale"
	trim_documentation "$1"
}

# Monado reads and writes pictures only when a camera is calibrated, and the library it does so with needs 100 packages, GDAL and
# ICU among them. A stand-in has the two functions; reaching one ends the service.
add_monado_stand_in() {
	local string=NSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE
	cc -shared -fPIC -nostdlib -Wl,-soname,libopencv_imgcodecs.so.410 -x c \
		-o "$1/root/usr/lib/$deb_triplet/libopencv_imgcodecs.so.410" - <<-C || die "cc could not build a library for Monado: is the disk full?"
		void _ZN2cv6imreadERK${string}i(void) { __builtin_trap(); }
		void _ZN2cv7imwriteERK${string}RKNS_11_InputArrayERKSt6vectorIiSaIiEE(void) { __builtin_trap(); }
	C
}

# What a program of ours opens, and in lib what that needs beyond Vulkan's loader. The manifest's path is relative to the manifest,
# so that it holds however the cache is reached.
add_monado_client() {
	local lib=root/usr/lib/$deb_triplet one
	mkdir "$1/lib"
	for one in libjsoncpp.so.26 libcjson.so.1 libGLX.so.0 libGLdispatch.so.0 libX11.so.6 libxcb.so.1 libXau.so.6 libXdmcp.so.6 \
		libbsd.so.0 libmd.so.0; do
		[ -e "$1/$lib/$one" ] || die "Debian's packages of Monado have no $one any more: scripts/monado.sh has to follow them"
		ln -s "../$lib/$one" "$1/lib/$one"
	done
	ln -s "$lib/libopenxr_loader.so.1" "$1/libopenxr_loader.so.1"
	cat >"$1/openxr_monado.json" <<-JSON
		{
		    "file_format_version": "1.0.0",
		    "runtime": { "name": "Monado", "library_path": "./$lib/libopenxr_monado.so" }
		}
	JSON
	# The X server has /usr/bin compiled in as xkbcomp's folder.
	python3 - "$1/root/usr/bin/Xvfb" <<-'PY' || die "Debian's Xvfb is not what scripts/monado.sh knows"
		import sys
		data = open(sys.argv[1], "rb").read()
		old = b"\0/usr/bin\0"
		if data.count(old) != 1:
		    sys.exit(f"/usr/bin stands in Xvfb {data.count(old)} times")
		open(sys.argv[1], "wb").write(data.replace(old, b"\0.".ljust(len(old), b"\0")))
	PY
}

# write_monado_wrapper PREFIX NAME WHAT <LINES: LINES set lib, the folders of libraries, of which all is every one, and may put the
# program before the arguments.
write_monado_wrapper() {
	{
		cat <<-WRAPPER
			#!/bin/sh
			# Written by ./run: runs $3, in the prefix this script lies in.
			here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
			all=\$here/root/usr/lib/$deb_triplet
			all=\$all:\$all/blas:\$all/lapack:\$all/pulseaudio
		WRAPPER
		sed "s/TRIPLET/$deb_triplet/"
		cat <<-WRAPPER
			# A Vulkan driver from a private prefix has its libraries beside it, and is to meet nothing of the machine's own Vulkan.
			case \${VK_DRIVER_FILES:-} in
			*:*) ;;
			*/root/usr/share/vulkan/icd.d/*.json)
			vulkan=\${VK_DRIVER_FILES%/usr/share/vulkan/*}
			lib=\$lib:\$vulkan/usr/lib/$deb_triplet
		WRAPPER
		# shellcheck disable=SC2016 # the wrapper has found it
		lavapipe_exports '$vulkan'
		cat <<-WRAPPER
			;;
			esac
		WRAPPER
		wrapper_tail "$monado_lock"
	} >"$1/$2"
	chmod +x "$1/$2"
}

# explain_no_monado: says why tests, or a display on OpenXR, have no runtime from here.
explain_no_monado() {
	say "OpenXR: Monado cannot be unpacked without dpkg-deb: install dpkg, or have a runtime that is active"
}

# export_monado CACHE: CACHE is $MON3TR_CACHE, or a path to it that lists of paths can hold.
export_monado() { export MON3TR_MONADO=${MON3TR_MONADO:-$1/monado}; }
