# shellcheck shell=bash disable=SC2154 # prepare.sh sets what is not assigned here
# The camera's networks: MediaPipe's models for body, hands and face (Apache-2.0), out of the wheel that Google publishes on PyPI; only
# they and the licence are unpacked, no Python package is installed. They are data: one wheel serves every machine. Sourced by ./run.
# The larger network for bodies, of recordings alone, is not in the wheel but in Google's npm package of the same networks.
#
#   $MON3TR_CACHE/networks/*.tflite

# Wheels 0.10.33 and newer hold no networks.
networks_version=0.10.21
networks_url=$pypi/ad/83/56f760fecdc60de84c529d6c05c9dfc7d972617c6632bd254d5e021e5b16/mediapipe-$networks_version-cp311-cp311-manylinux_2_28_x86_64.whl
networks_sha256=05dc4a9e593655a79558d05d6227d31018c2537a4bd3362b51e230cf22aecfe3

# SHA-256 and path in the wheel.
networks_members=(
	9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c=mediapipe/modules/pose_detection/pose_detection.tflite
	e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f=mediapipe/modules/pose_landmark/pose_landmark_full.tflite
	67d996ce96f9d36fe17d2693022c6da93168026ab2f028f9e2365398d8ac7d5d=mediapipe/modules/holistic_landmark/hand_recrop.tflite
	11c272b891e1a99ab034208e23937a8008388cf11ed2a9d776ed3d01d0ba00e3=mediapipe/modules/hand_landmark/hand_landmark_full.tflite
	048edd3645c9bf7397d19a9f6e3a42957d6e414c9bea6598030a2e9b624156e6=mediapipe/modules/hand_landmark/hand_landmark_lite.tflite
	1b14e9422c6ad006cde6581a46c8b90dd573c07ab7f3934b5589e7cea3f89a54=mediapipe/modules/palm_detection/palm_detection_full.tflite
	bbff11cebd1eb27a1e004cae0b0e63ec8c551cbf34a4451148b4908b8db3eca8=mediapipe/modules/face_detection/face_detection_short_range.tflite
	e06a804e0144f9929eda782122916b35d60c697c3c9344013ca2bbe76a6ce2b4=mediapipe/modules/face_landmark/face_landmark_with_attention.tflite
	8707eef0533987efc5b155d64761eeb6e20793f50b9bd1a68dad1cf4719d0ed8=mediapipe-$networks_version.dist-info/LICENSE
)

heavy_body_version=0.5.1675471629
heavy_body_url=https://registry.npmjs.org/@mediapipe/holistic/-/holistic-$heavy_body_version.tgz
heavy_body_sha256=8a3c0632e40e761e637d020738e96dc54d9bbbd4330ce2b206469fe467fd708b
# The package says what its licence is (Apache-2.0) but lacks the text, which is the same as the wheel's.
heavy_body_member=pose_landmark_heavy.tflite

networks_pins() { printf '%s\n' "$networks_sha256" "${networks_members[@]}" | sha256sum | cut -d' ' -f1; }

networks_are_there() { [ -n "${MON3TR_NETWORKS:-}" ] || is_stamped "$MON3TR_CACHE/networks" "$(networks_pins)"; }

export_networks() { export MON3TR_NETWORKS=${MON3TR_NETWORKS:-$MON3TR_CACHE/networks}; }

install_networks() {
	local wheel=$MON3TR_CACHE/download/mediapipe-$networks_version.whl new=$MON3TR_CACHE/networks.new
	say "Fetching MediaPipe's networks $networks_version from PyPI"
	must_fetch "$networks_url" "$networks_sha256" "$wheel"
	rm -rf "$new"
	mkdir -p "$new"
	# python3 instead of unzip, which a fresh machine lacks.
	python3 - "$wheel" "$new" "${networks_members[@]}" <<-'PY' || die "could not unpack $wheel: is the disk full?"
		import hashlib, os, sys, zipfile
		wheel, folder, *members = sys.argv[1:]
		with zipfile.ZipFile(wheel) as archive:
		    for one in members:
		        sha256, member = one.split("=")
		        content = archive.read(member)
		        if hashlib.sha256(content).hexdigest() != sha256:
		            sys.exit(f"{member} is not the file that was pinned (SHA-256 {sha256})")
		        with open(os.path.join(folder, os.path.basename(member)), "wb") as target:
		            target.write(content)
	PY
	put_in_place "$new" "$MON3TR_CACHE/networks" "$(networks_pins)"
	rm -f "$wheel"
}

# Beside the others, so that one folder has all. They are replaced as a whole, and this one is then fetched anew.
heavy_body_is_there() { [ -n "${MON3TR_NETWORKS:-}" ] || { networks_are_there && is_stamped "$MON3TR_CACHE/networks/heavy" "$heavy_body_sha256"; }; }

install_heavy_body() {
	local archive=$MON3TR_CACHE/download/holistic-$heavy_body_version.tgz new=$MON3TR_CACHE/networks/heavy.new
	say "Fetching MediaPipe's larger network for bodies $heavy_body_version from the npm registry"
	must_fetch "$heavy_body_url" "$heavy_body_sha256" "$archive"
	rm -rf "$new"
	mkdir -p "$new"
	tar -xzf "$archive" -C "$new" --strip-components=1 --no-same-owner --no-same-permissions "package/$heavy_body_member" package/package.json ||
		die "could not unpack $archive: is the disk full?"
	chmod -R u=rwX,go=rX "$new"
	mv "$new/$heavy_body_member" "$MON3TR_CACHE/networks/"
	put_in_place "$new" "$MON3TR_CACHE/networks/heavy" "$heavy_body_sha256"
	rm -f "$archive"
}
