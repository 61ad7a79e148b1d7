# shellcheck shell=bash disable=SC2034 # debian.sh reads fetch_gone
# Fetching into the cache: every file is pinned by its SHA-256, written under a temporary name and renamed when it is whole
# and right, so that an interrupted set-up goes on where it stopped. Sourced by ./run; does not know what is fetched.

say() { printf '%s\n' "$*" >&2; }

die() {
	printf '\nmon3tr: %s\n' "$*" >&2
	exit 1
}

# has_sha256 FILE SHA256
has_sha256() {
	[ -f "$1" ] && [ "$(sha256sum "$1" | cut -d' ' -f1)" = "$2" ]
}

# fetch URL SHA256 FILE: FILE exists and is right afterwards, or this returns 1 and $fetch_error says why in one line;
# $fetch_gone is 1 if the server answered that it has no such file.
fetch() {
	local url=$1 sha256=$2 file=$3 part=$3.part try meter=--silent why
	fetch_gone=0
	if [ -f "$file" ]; then return 0; fi
	if [ -t 2 ]; then meter=--progress-bar; fi
	mkdir -p "$(dirname "$file")"
	for try in 1 2; do
		# What was left of an earlier run may have been something else: the second round starts afresh.
		if [ "$try" = 2 ]; then rm -f "$part"; fi
		if ! has_sha256 "$part" "$sha256"; then
			if ! why=$(curl --fail --location --retry 3 --connect-timeout 20 --speed-limit 1000 --speed-time 60 \
				--continue-at - "$meter" --write-out '%{http_code} %{errormsg}' --output "$part" "$url"); then
				fetch_error="could not fetch $url: ${why#* }"
				case $why in 404* | 410*) fetch_gone=1 && return 1 ;; esac
				continue
			fi
			if ! has_sha256 "$part" "$sha256"; then
				fetch_error="$url is not the file that was pinned (SHA-256 $sha256)"
				continue
			fi
		fi
		mv "$part" "$file"
		return 0
	done
	return 1
}

die_of_network() {
	die "$fetch_error. Check the network (a proxy is set with https_proxy=...) and run the command again; what is already here is kept."
}

# must_fetch URL SHA256 FILE
must_fetch() { fetch "$@" || die_of_network; }

# is_stamped FOLDER PINS: FOLDER was completed from exactly these pins. Only reads the stamp: nothing is hashed again.
is_stamped() {
	[ -f "$1/.stamp" ] && [ "$(cat "$1/.stamp")" = "$2" ]
}

# put_in_place NEW FOLDER PINS: stamps the finished folder NEW and puts it in FOLDER's place.
put_in_place() {
	printf '%s\n' "$3" >"$1/.stamp"
	rm -rf "$2.old"
	if [ -e "$2" ]; then mv "$2" "$2.old"; fi
	mv "$1" "$2"
	rm -rf "$2.old"
}
