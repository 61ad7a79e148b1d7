# shellcheck shell=bash disable=SC2154,SC2034,SC2094 # callers set what is not assigned here, and read trust; a lock is only read
# Programs and libraries from Debian packages in a private prefix, without root: a lock file pins every package by version and
# SHA-256 (scripts/lock-debian.py writes them). Sourced by ./run; the callers decide what is unpacked.
#
#   PREFIX/root   the packages' files
#   PREFIX/libc   libc6's files, apart: they are left alone where the machine's own libc is as new

debian_mirror=${MON3TR_DEBIAN_MIRROR:-https://deb.debian.org/debian}
debian_snapshot=https://snapshot.debian.org/archive/debian

# lock_megabytes LOCK...: megabytes to fetch
lock_megabytes() { awk '!/^#/ && NF == 5 { sum += $4 } END { printf "%d", sum / 1e6 }' "$@"; }

# locked_version LOCK PACKAGE: without an epoch
locked_version() { sed -n "s/^$2 \([0-9]*:\)\{0,1\}\([0-9.]*\).*/\2/p" "$1"; }

# debs_are_ready FOLDER PINS: FOLDER holds the locked packages, or the ones that had to be taken instead of some of them, which
# its stamp then names; what was taken on trust is used only as long as that is allowed.
debs_are_ready() {
	local stamp
	if is_stamped "$1" "$2"; then return 0; fi
	stamp=$(cat "$1/.stamp" 2>/dev/null) || return 1
	case $stamp in
	"$2, but unsigned "*) [ "${MON3TR_ALLOW_UNPINNED:-}" = 1 ] ;;
	"$2, but signed "*) ;;
	*) return 1 ;;
	esac
}

# Debian's index of the suite as it is now, once: $debs/Packages. $index_is is `signed` if Debian's signature vouches for it,
# else `unsigned`, which has to be allowed.
fetch_index() {
	local suite=$1 name=$2 debs=$3 dists=$debian_mirror/dists/$1 index=main/binary-$debian_arch/Packages.xz
	local keyrings=() one why=""
	if [ -n "$index_is" ]; then return; fi
	rm -f "$debs"/Packages* "$debs"/Release "$debs"/InRelease
	for one in /usr/share/keyrings/debian-archive-*.gpg /usr/share/keyrings/debian-archive-*.pgp; do
		if [ -f "$one" ]; then keyrings+=(--keyring "$one"); fi
	done
	if ! command -v gpgv >/dev/null; then
		why="gpgv is missing"
	elif [ ${#keyrings[@]} = 0 ]; then
		why="debian-archive-keyring is missing"
	fi
	if [ -n "$why" ] && [ "${MON3TR_ALLOW_UNPINNED:-}" != 1 ]; then
		die "$name is not available in its locked version, and the signature of Debian's list of newer ones cannot be checked ($why): apt-get install gpgv debian-archive-keyring, or trust $debian_mirror with MON3TR_ALLOW_UNPINNED=1, and run the command again"
	fi
	download "$dists/$index" "$debs/Packages.xz"
	index_is=unsigned
	if [ -z "$why" ]; then
		download "$dists/InRelease" "$debs/InRelease"
		gpgv --quiet "${keyrings[@]}" --output "$debs/Release" "$debs/InRelease" 2>"$debs/Release.why" ||
			die "the signature of $dists/InRelease is not Debian's ($(tail -n 1 "$debs/Release.why")): use another mirror (MON3TR_DEBIAN_MIRROR)"
		# Debian signs every suite with the same keys.
		grep -q "^Codename: $suite\$" "$debs/Release" || die "$dists/InRelease is not that of Debian $suite: use another mirror (MON3TR_DEBIAN_MIRROR)"
		one=$(awk -v want="$index" '/^[^ ]/ { at = ($1 == "SHA256:") } at && $3 == want { print $1; exit }' "$debs/Release")
		has_sha256 "$debs/Packages.xz" "${one:-none}" ||
			die "$dists/$index is not the file that Debian signed: the mirror may be in the middle of an update; run the command again later"
		index_is=signed
	fi
	python3 -c 'import lzma, sys; sys.stdout.buffer.write(lzma.open(sys.argv[1]).read())' "$debs/Packages.xz" >"$debs/Packages" ||
		die "could not unpack $debs/Packages.xz: is the disk full, or does this python3 lack lzma?"
}

# download URL FILE: for what has no pin.
download() {
	curl --fail --silent --location --retry 3 --connect-timeout 20 --output "$2" "$1" ||
		die "could not fetch $1. Check the network (a proxy is set with https_proxy=...) and run the command again; what is already here is kept."
}

# fetch_moved_package LOCK NAME VERSION SHA256 PATH DEBS
# One package that the mirror no longer carries in the locked version, as happens after a Debian point release:
# Debian's archive of everything it ever carried first, else what the suite carries now, with the hash its index states.
# Sets deb to the path of the .deb, and adds to instead what is not as locked.
fetch_moved_package() {
	local lock=$1 name=$2 version=$3 sha256=$4 path=$5 debs=$6 suite snapshot now
	suite=$(sed -n 's/^suite //p' "$lock")
	snapshot=$(sed -n 's/^snapshot //p' "$lock")
	say "  $name $version is not on $debian_mirror any more, as happens after a Debian point release"
	say "  trying Debian's archive, snapshot.debian.org"
	deb=$debs/$sha256.deb
	if fetch "$debian_snapshot/$snapshot/$path" "$sha256" "$deb"; then return; fi
	fetch_index "$suite" "$name $version" "$debs"
	now=$(awk -v want="$name" '/^Package: /{ at = ($2 == want) } at && /^(Version|SHA256|Filename): /{ v[$1] = $2 }
		END { print v["Version:"], v["SHA256:"], v["Filename:"] }' "$debs/Packages")
	read -r version sha256 path <<<"$now"
	[ -n "$path" ] || die "Debian $suite has no package $name any more: renew $lock with scripts/lock-debian.py"
	say "  taking $name $version instead, which Debian $suite carries now (not the locked version; hash from the suite's $index_is index)"
	deb=$debs/$sha256.deb
	must_fetch "$debian_mirror/$path" "$sha256" "$deb"
	instead+="${instead:+, }$name $version"
	if [ "$index_is" = unsigned ]; then trust=unsigned; fi
}

# unpack_lock LOCK NEW: all packages of LOCK below the folder NEW. Adds to the caller's `instead` what is not as locked, and turns
# its `trust` from `signed` to `unsigned` where no signature covers that.
unpack_lock() {
	local lock=$1 new=$2 debs=$MON3TR_CACHE/download/debs name version sha256 path deb list into index_is=""
	mkdir -p "$debs" "$new/root" "$new/libc"
	# All at once first, because one connection per package takes a minute; each is checked, and fetched again alone if need be, below.
	list=$(mktemp)
	while read -r name version sha256 _ path; do
		if [ -z "$path" ] || [ "$name" = "#" ] || [ -f "$debs/$sha256.deb" ]; then continue; fi
		printf 'url = "%s/%s"\noutput = "%s/%s.deb.part"\n' "$debian_mirror" "$path" "$debs" "$sha256"
	done <"$lock" >"$list"
	if [ -s "$list" ]; then
		curl --parallel --parallel-max 6 --fail --silent --location --retry 3 --connect-timeout 20 --config "$list" 2>/dev/null || true
	fi
	rm -f "$list"
	while read -r name version sha256 _ path; do
		if [ -z "$path" ] || [ "$name" = "#" ]; then continue; fi
		deb=$debs/$sha256.deb
		if ! fetch "$debian_mirror/$path" "$sha256" "$deb"; then
			if [ "$fetch_gone" = 0 ]; then die_of_network; fi
			fetch_moved_package "$lock" "$name" "$version" "$sha256" "$path" "$debs"
		fi
		into=$new/root
		if [ "$name" = libc6 ]; then into=$new/libc; fi
		dpkg-deb --extract "$deb" "$into" || die "could not unpack $deb: is the disk full? Delete that file and run the command again."
	done <"$lock"
	rm -rf "$debs"
}

# trim_documentation PREFIX: copyright files stay: this is other people's work.
trim_documentation() {
	local share=$1/root/usr/share
	rm -rf "$share/bug" "$share/lintian" "$share/man" "$share/locale" "$1/libc/usr/lib/$deb_triplet/gconv" "$1/libc/usr/share/locale"
	find "$1" -path '*/usr/share/doc/*' -name '*changelog*' -delete
}

# wrapper_tail LOCK [NAME]: the end of a wrapper script that runs "$@" on the prefix in $here: on the machine's libc if that is as
# new as the locked one, else through the locked dynamic linker. NAME, words of a shell, is what the program then takes for its own
# path, where it starts itself again.
wrapper_tail() {
	local libc_version
	libc_version=$(locked_version "$1" libc6)
	cat <<WRAPPER
own=\$(getconf GNU_LIBC_VERSION 2>/dev/null)
newest=\$(printf '%s\n' "\${own#glibc }" $libc_version | sort -V | tail -n 1)
if [ "\${own#glibc }" = "\$newest" ]; then
	export LD_LIBRARY_PATH="\$lib\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}"
	exec "\$@"
fi
libc=\$here/libc/usr/lib/$deb_triplet
exec "\$libc/$dynamic_linker" ${2:+--argv0 $2 }--library-path "\$libc:\$lib\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}" "\$@"
WRAPPER
}

# lock_pins LOCK LAYOUT: what the stamp of a folder made from LOCK says. LAYOUT is raised when what is unpacked, trimmed or written
# into the wrapper changes.
lock_pins() { echo "$(sha256sum <"$1" | cut -d' ' -f1) layout $2"; }

# install_program NAME LOCK PACKAGE PATH PINS: the program at PATH in the packages of LOCK, with its libraries, below
# $MON3TR_CACHE/NAME; `run ARGS...` there is the program with ARGS, under the same process id. The version of PACKAGE is printed.
install_program() {
	local name=$1 lock=$2 package=$3 program=$4 pins=$5 prefix=$MON3TR_CACHE/$1 new=$MON3TR_CACHE/$1.new instead="" trust=signed
	say "Fetching $name $(locked_version "$lock" "$package") from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$lock" "$new"
	if [ -d "$new/root/usr/bin" ]; then find "$new/root/usr/bin" -type f ! -name "$name" -delete; fi
	trim_documentation "$new"
	{
		cat <<WRAPPER
#!/bin/sh
# Written by ./run: $name in the prefix this script lies in.
here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
lib=\$here/root/usr/lib/$deb_triplet
set -- "\$here/root/$program" "\$@"
WRAPPER
		wrapper_tail "$lock"
	} >"$new/run"
	chmod +x "$new/run"
	put_in_place "$new" "$prefix" "$pins${instead:+, but $trust $instead}"
}

# program_is_there VARIABLE NAME PINS: something to point VARIABLE at, the user's choice, the machine's own, or what
# install_program left.
program_is_there() {
	[ -n "${!1:-}" ] || command -v "$2" >/dev/null || debs_are_ready "$MON3TR_CACHE/$2" "$3"
}

# export_program VARIABLE NAME
export_program() {
	if [ -n "${!1:-}" ]; then return; fi
	export "$1=$(command -v "$2" || echo "$MON3TR_CACHE/$2/run")"
}
