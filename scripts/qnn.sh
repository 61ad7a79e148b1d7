# shellcheck shell=bash disable=SC2154 # prepare.sh sets what is not assigned here
# QNN, ONNX Runtime's way to Qualcomm's NPUs: the plugin and its compiler and emulator of the Hexagon, out of the wheel that
# is published on PyPI; only those libraries and their licences are unpacked, no Python package is installed. Sourced by ./run.
#
# The plugin is MIT-licensed; Qualcomm's libraries may be passed on only inside an application (Qualcomm_LICENSE.pdf, unpacked
# beside them): so they are fetched where they are used, and never committed.
#
#   $MON3TR_CACHE/qnn/onnxruntime_qnn/libonnxruntime_providers_qnn.so

qnn_version=2.7.0
qnn_url=$pypi/dc/cc/f237c96e9c5b8de2fdcd048310572ebf5116917c832c6955f8b7c31f91ff/onnxruntime_qnn-$qnn_version-cp312-cp312-manylinux_2_35_x86_64.whl
qnn_sha256=6feb735e2910127febd9c24c1be0f541bcaf688a90028b7efe55d12aca214c13
# The wheel's tag names 2.35; this is the newest version that its libraries name.
qnn_glibc=2.34

# Raise this when what is unpacked changes.
qnn_pins() { echo "$qnn_sha256 layout 1"; }

# qnn_lacks: prints why QNN cannot run here; fails if it can.
qnn_lacks() {
	local own
	if [ "$debian_arch" != amd64 ]; then
		echo "QNN's emulator is published for x86-64 alone, and this machine is $(uname -m)"
		return
	fi
	# Programs that go through lavapipe's wrapper run on the wrapper's newer libc.
	if [ "$vulkan_from" = cache ]; then return 1; fi
	own=$(getconf GNU_LIBC_VERSION 2>/dev/null) || own=
	if [ "$(printf '%s\n' "${own#glibc }" "$qnn_glibc" | sort -V | head -n 1)" = "$qnn_glibc" ]; then return 1; fi
	echo "QNN needs glibc $qnn_glibc or newer, and this machine has ${own:-another C library}: use a newer system, or --gpu lavapipe, which brings its own"
}

qnn_is_there() { [ -n "${MON3TR_QNN:-}" ] || is_stamped "$MON3TR_CACHE/qnn" "$(qnn_pins)"; }

install_qnn() {
	local wheel=$MON3TR_CACHE/download/onnxruntime-qnn-$qnn_version.whl new=$MON3TR_CACHE/qnn.new
	say "Fetching ONNX Runtime's QNN plugin $qnn_version from PyPI"
	must_fetch "$qnn_url" "$qnn_sha256" "$wheel"
	rm -rf "$new"
	mkdir -p "$new"
	python3 - "$wheel" "$new" <<-'PY' || die "could not unpack $wheel: is the disk full?"
		import os, shutil, sys, zipfile
		wheel, folder = sys.argv[1:]
		wanted = ["libonnxruntime_providers_qnn.so", "libQnnHtp.so", "libHtpPrepare.so", "libQnnSystem.so", "libQnnIr.so",
		          "LICENSE", "Qualcomm_LICENSE.pdf", "ThirdPartyNotices.txt"]
		members = [f"onnxruntime_qnn/{name}" for name in wanted]
		with zipfile.ZipFile(wheel) as archive:
		    # The C++ library they were built with, where their run path looks for it.
		    members += [name for name in archive.namelist() if name.startswith("onnxruntime_qnn.libs/")]
		    for member in members:
		        target = os.path.join(folder, member)
		        os.makedirs(os.path.dirname(target), exist_ok=True)
		        with archive.open(member) as source, open(target, "wb") as file:
		            shutil.copyfileobj(source, file)
	PY
	put_in_place "$new" "$MON3TR_CACHE/qnn" "$(qnn_pins)"
	rm -f "$wheel"
}

export_qnn() { export MON3TR_QNN=${MON3TR_QNN:-$MON3TR_CACHE/qnn/onnxruntime_qnn}; }
