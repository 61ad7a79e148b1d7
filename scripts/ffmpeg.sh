# shellcheck shell=bash disable=SC2154 # prepare.sh sets what is not assigned here
# ffmpeg, which decodes videos and addresses: the machine's own, or the one in the wheel that imageio publishes on PyPI; only
# that file and the wheel's licence are unpacked. Sourced by ./run.
#
#   $MON3TR_CACHE/ffmpeg/ffmpeg

# The wheels before 0.8 hold one that is linked statically: it crashes on every network address.
ffmpeg_wheel=0.8.1
ffmpeg_version=9.0.2
ffmpeg_files=https://files.pythonhosted.org/packages
case $debian_arch in
amd64)
	ffmpeg_url=$ffmpeg_files/de/0f/49292fbef69ee10ebcf97bb741602521caafcc6966d5fa1a2b868cc15655/imageio_ffmpeg-$ffmpeg_wheel-py3-none-manylinux_2_28_x86_64.whl
	ffmpeg_sha256=050d6850601c3b3890bd2b28306f3b842b3daea390a561101174375a1c460bda
	ffmpeg_megabytes=68
	;;
arm64)
	ffmpeg_url=$ffmpeg_files/53/02/e139e53a71f33f728cb2ce6c1124edc29e4c008427923f01a4d37f9a1867/imageio_ffmpeg-$ffmpeg_wheel-py3-none-manylinux_2_28_aarch64.whl
	ffmpeg_sha256=fad3176f859b25869e60a8ed79957d4e3ed74a97a95e5f0cdcb91455f6c6d00e
	ffmpeg_megabytes=61
	;;
esac

# Whether the one on the PATH is 5.1 or newer. Builds from its repository have no such number, so the option counts that came with
# 5.1 and that the tracker passes.
ffmpeg_on_path_serves() {
	command -v ffmpeg >/dev/null || return 1
	local options
	options=$(ffmpeg -hide_banner -h long </dev/null 2>/dev/null) || return 1
	[[ $options == *-fps_mode* ]]
}

ffmpeg_is_there() {
	[ -n "${MON3TR_FFMPEG:-}" ] || ffmpeg_on_path_serves || is_stamped "$MON3TR_CACHE/ffmpeg" "$ffmpeg_sha256"
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
		    for member, name in {program: "ffmpeg", f"imageio_ffmpeg-{version}.dist-info/licenses/LICENSE": "LICENSE"}.items():
		        with archive.open(member) as source, open(os.path.join(folder, name), "wb") as target:
		            shutil.copyfileobj(source, target)
	PY
	chmod +x "$new/ffmpeg"
	"$new/ffmpeg" -version >/dev/null 2>&1 || die "ffmpeg from PyPI does not run here: install your distribution's (apt-get install ffmpeg), or set MON3TR_FFMPEG"
	put_in_place "$new" "$MON3TR_CACHE/ffmpeg" "$ffmpeg_sha256"
	rm -f "$wheel"
}

# One on the PATH is found there; an older one there is passed over.
export_ffmpeg() {
	if [ -n "${MON3TR_FFMPEG:-}" ]; then
		export MON3TR_FFMPEG
	elif ! ffmpeg_on_path_serves; then
		export MON3TR_FFMPEG=$MON3TR_CACHE/ffmpeg/ffmpeg
	fi
}
