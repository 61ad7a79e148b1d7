# shellcheck shell=bash disable=SC2154 # prepare.sh sets what is not assigned here
# ffmpeg, which decodes videos and addresses: the machine's own, or the static one in the wheel that imageio publishes on PyPI; only
# that file and the wheel's licence are unpacked. Sourced by ./run.
#
#   $MON3TR_CACHE/ffmpeg/ffmpeg

ffmpeg_wheel=0.6.0
ffmpeg_version=7.0.2
ffmpeg_files=https://files.pythonhosted.org/packages
case $debian_arch in
amd64)
	ffmpeg_url=$ffmpeg_files/a0/2d/43c8522a2038e9d0e7dbdf3a61195ecc31ca576fb1527a528c877e87d973/imageio_ffmpeg-$ffmpeg_wheel-py3-none-manylinux2014_x86_64.whl
	ffmpeg_sha256=c7e46fcec401dd990405049d2e2f475e2b397779df2519b544b8aab515195282
	ffmpeg_megabytes=29
	;;
arm64)
	ffmpeg_url=$ffmpeg_files/33/e7/1925bfbc563c39c1d2e82501d8372734a5c725e53ac3b31b4c2d081e895b/imageio_ffmpeg-$ffmpeg_wheel-py3-none-manylinux2014_aarch64.whl
	ffmpeg_sha256=1d47bebd83d2c5fc770720d211855f208af8a596c82d17730aa51e815cdee6dc
	ffmpeg_megabytes=26
	;;
esac

ffmpeg_is_there() {
	[ -n "${MON3TR_FFMPEG:-}" ] || command -v ffmpeg >/dev/null || is_stamped "$MON3TR_CACHE/ffmpeg" "$ffmpeg_sha256"
}

install_ffmpeg() {
	local wheel=$MON3TR_CACHE/download/imageio-ffmpeg-$ffmpeg_wheel.whl new=$MON3TR_CACHE/ffmpeg.new
	say "Fetching ffmpeg $ffmpeg_version from PyPI"
	must_fetch "$ffmpeg_url" "$ffmpeg_sha256" "$wheel"
	rm -rf "$new"
	mkdir -p "$new"
	# python3 instead of unzip, which a fresh machine lacks.
	python3 - "$wheel" "$new" "$ffmpeg_wheel" <<-'PY' || die "could not unpack $wheel: is the disk full?"
		import os, shutil, sys, zipfile
		wheel, folder, version = sys.argv[1:]
		with zipfile.ZipFile(wheel) as archive:
		    [program] = [name for name in archive.namelist() if name.startswith("imageio_ffmpeg/binaries/ffmpeg-linux-")]
		    for member, name in {program: "ffmpeg", f"imageio_ffmpeg-{version}.dist-info/LICENSE": "LICENSE"}.items():
		        with archive.open(member) as source, open(os.path.join(folder, name), "wb") as target:
		            shutil.copyfileobj(source, target)
	PY
	chmod +x "$new/ffmpeg"
	"$new/ffmpeg" -version >/dev/null 2>&1 || die "ffmpeg from PyPI does not run here: install your distribution's (apt-get install ffmpeg), or set MON3TR_FFMPEG"
	put_in_place "$new" "$MON3TR_CACHE/ffmpeg" "$ffmpeg_sha256"
	rm -f "$wheel"
}

# One on the PATH is found there.
export_ffmpeg() {
	if [ -n "${MON3TR_FFMPEG:-}" ]; then
		export MON3TR_FFMPEG
	elif ! command -v ffmpeg >/dev/null; then
		export MON3TR_FFMPEG=$MON3TR_CACHE/ffmpeg/ffmpeg
	fi
}
