# shellcheck shell=bash disable=SC2154 # prepare.sh sets what is not assigned here
# ONNX Runtime: the shared library out of the wheel that Microsoft publishes on PyPI; only that file and its licences are
# unpacked, no Python package is installed. Sourced by ./run.
#
#   $MON3TR_CACHE/onnxruntime/libonnxruntime.so

ort_version=1.31.1
pypi=https://files.pythonhosted.org/packages
case $debian_arch in
amd64)
	ort_url=$pypi/eb/27/c6a823bac55b2977bea2027c3ec9393a2c1002cb9a09eb40354563e02730/onnxruntime-$ort_version-cp312-cp312-manylinux_2_28_x86_64.whl
	ort_sha256=1f3dea47f2f0e5117c2404cea7d21fd253ae7836a3bf167a501cdfbb2600d536
	;;
arm64)
	ort_url=$pypi/ba/e4/1ed1a7a5f4702d899091fa2b976d377995250c307326ec8dc9ae6378aa13/onnxruntime-$ort_version-cp312-cp312-manylinux_2_28_aarch64.whl
	ort_sha256=0b9a492176886992e0e875f06bc0367e333f5fff11711a2d642e18b02f3009cc
	;;
esac

install_onnxruntime() {
	local wheel=$MON3TR_CACHE/download/onnxruntime-$ort_version.whl new=$MON3TR_CACHE/onnxruntime.new
	say "Fetching ONNX Runtime $ort_version from PyPI"
	must_fetch "$ort_url" "$ort_sha256" "$wheel"
	rm -rf "$new"
	mkdir -p "$new"
	# python3 instead of unzip, which a fresh machine lacks.
	python3 - "$wheel" "$new" "$ort_version" <<-'PY' || die "could not unpack $wheel: is the disk full?"
		import os, shutil, sys, zipfile
		wheel, folder, version = sys.argv[1:]
		members = {
		    f"onnxruntime/capi/libonnxruntime.so.{version}": f"libonnxruntime.so.{version}",
		    "onnxruntime/LICENSE": "LICENSE",
		    "onnxruntime/ThirdPartyNotices.txt": "ThirdPartyNotices.txt",
		}
		with zipfile.ZipFile(wheel) as archive:
		    for member, name in members.items():
		        with archive.open(member) as source, open(os.path.join(folder, name), "wb") as target:
		            shutil.copyfileobj(source, target)
	PY
	ln -s "libonnxruntime.so.$ort_version" "$new/libonnxruntime.so"
	put_in_place "$new" "$MON3TR_CACHE/onnxruntime" "$ort_sha256"
	rm -f "$wheel"
}
