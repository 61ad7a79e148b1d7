# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# Mesa's lavapipe (Vulkan on the CPU) in a private prefix, unpacked from the Debian packages that lavapipe-ARCH.lock pins:
# no root, nothing outside the cache. Sourced by ./run; whether it is needed at all, prepare.sh decides.
#
#   $MON3TR_CACHE/lavapipe/root   the packages' files
#   $MON3TR_CACHE/lavapipe/libc   libc6's files, apart: they are left alone where the machine's own libc is as new
#   $MON3TR_CACHE/lavapipe/run    the wrapper: `run PROGRAM ARGS...` runs PROGRAM so that the prefix's libraries load

debian_mirror=${MON3TR_DEBIAN_MIRROR:-https://deb.debian.org/debian}
debian_snapshot=https://snapshot.debian.org/archive/debian
lavapipe_lock=$repo/scripts/lavapipe-$debian_arch.lock

# Raise this when what is unpacked, trimmed or written into the wrapper changes.
lavapipe_layout=1

lavapipe_pins() { echo "$(sha256sum <"$lavapipe_lock" | cut -d' ' -f1) layout $lavapipe_layout"; }

# lavapipe_version: the locked Mesa, for messages
lavapipe_version() { sed -n 's/^mesa-vulkan-drivers \([0-9.]*\).*/\1/p' "$lavapipe_lock"; }

lavapipe_bytes() { awk '!/^#/ && NF == 5 { sum += $4 } END { printf "%d", sum / 1e6 }' "$lavapipe_lock"; }

# lavapipe_is_ready FOLDER: FOLDER holds the locked packages, or the ones that had to be taken instead of some of them, which
# its stamp then names; what was taken on trust is used only as long as that is allowed.
lavapipe_is_ready() {
	local stamp pins
	pins=$(lavapipe_pins)
	if is_stamped "$1" "$pins"; then return 0; fi
	stamp=$(cat "$1/.stamp" 2>/dev/null) || return 1
	case $stamp in
	"$pins, but unsigned "*) [ "${MON3TR_ALLOW_UNPINNED:-}" = 1 ] ;;
	"$pins, but signed "*) ;;
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
		die "$name is not to be had in its locked version, and the signature of Debian's list of newer ones cannot be checked ($why): apt-get install gpgv debian-archive-keyring, or trust $debian_mirror with MON3TR_ALLOW_UNPINNED=1, and run the command again"
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

# One package that the mirror no longer carries in the locked version, as happens after a Debian point release:
# Debian's archive of everything it ever carried first, else what the suite carries now, with the hash its index states.
# Sets deb to the path of the .deb, and adds to instead what is not as locked.
fetch_moved_package() {
	local name=$1 version=$2 sha256=$3 path=$4 debs=$5 suite snapshot now
	suite=$(sed -n 's/^suite //p' "$lavapipe_lock")
	snapshot=$(sed -n 's/^snapshot //p' "$lavapipe_lock")
	say "  $name $version is not on $debian_mirror any more, as happens after a Debian point release"
	say "  trying Debian's archive, snapshot.debian.org"
	deb=$debs/$sha256.deb
	if fetch "$debian_snapshot/$snapshot/$path" "$sha256" "$deb"; then return; fi
	fetch_index "$suite" "$name $version" "$debs"
	now=$(awk -v want="$name" '/^Package: /{ at = ($2 == want) } at && /^(Version|SHA256|Filename): /{ v[$1] = $2 }
		END { print v["Version:"], v["SHA256:"], v["Filename:"] }' "$debs/Packages")
	read -r version sha256 path <<<"$now"
	[ -n "$path" ] || die "Debian $suite has no package $name any more: renew scripts/lavapipe-$debian_arch.lock with scripts/lock-lavapipe.py"
	say "  taking $name $version instead, which Debian $suite carries now (not the locked version; hash from the suite's $index_is index)"
	deb=$debs/$sha256.deb
	must_fetch "$debian_mirror/$path" "$sha256" "$deb"
	instead+="${instead:+, }$name $version"
}

write_lavapipe_wrapper() {
	local prefix=$1 libc_version
	libc_version=$(sed -n 's/^libc6 \([0-9]*\.[0-9]*\).*/\1/p' "$lavapipe_lock")
	cat >"$prefix/run" <<WRAPPER
#!/bin/sh
# Written by ./run: runs a program so that it finds the lavapipe prefix this script lies in.
#
#   run PROGRAM ARGS...    PROGRAM with a path, not looked up in PATH
#
# The driver needs glibc $libc_version. Where the machine's own is older, the program runs on the prefix's: through its dynamic
# linker, so /proc/self/exe is that linker, and children run on the machine's libc as ever unless they are wrapped too.
# Cargo runs programs and tests through this (CARGO_TARGET_..._RUNNER); a test that starts a program of ours puts
# \$MON3TR_RUNNER before it when that is set. The Vulkan variables are set only where the caller has not set them.
here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
lib=\$here/root/usr/lib/$deb_triplet
export VK_DRIVER_FILES="\${VK_DRIVER_FILES-\$here/root/usr/share/vulkan/icd.d/lvp_icd.json}"
export VK_ICD_FILENAMES="\${VK_ICD_FILENAMES-\$VK_DRIVER_FILES}"
export VK_LAYER_PATH="\${VK_LAYER_PATH-\$here/root/usr/share/vulkan/explicit_layer.d}"
export XKB_CONFIG_ROOT="\${XKB_CONFIG_ROOT-\$here/root/usr/share/X11/xkb}"
own=\$(getconf GNU_LIBC_VERSION 2>/dev/null)
newest=\$(printf '%s\n' "\${own#glibc }" $libc_version | sort -V | tail -n 1)
if [ "\${own#glibc }" = "\$newest" ]; then
	export LD_LIBRARY_PATH="\$lib\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}"
	exec "\$@"
fi
libc=\$here/libc/usr/lib/$deb_triplet
exec "\$libc/$dynamic_linker" --library-path "\$libc:\$lib\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}" "\$@"
WRAPPER
	chmod +x "$prefix/run"
}

install_lavapipe() {
	local prefix=$MON3TR_CACHE/lavapipe new=$MON3TR_CACHE/lavapipe.new debs=$MON3TR_CACHE/download/debs
	local name version sha256 path deb list into pins instead="" index_is=""
	say "Fetching lavapipe $(lavapipe_version) from $debian_mirror"
	mkdir -p "$debs"
	rm -rf "$new"
	mkdir -p "$new/root" "$new/libc"
	# All at once first, because one connection per package takes a minute; each is checked, and fetched again alone if need be, below.
	list=$(mktemp)
	while read -r name version sha256 _ path; do
		if [ -z "$path" ] || [ "$name" = "#" ] || [ -f "$debs/$sha256.deb" ]; then continue; fi
		printf 'url = "%s/%s"\noutput = "%s/%s.deb.part"\n' "$debian_mirror" "$path" "$debs" "$sha256"
	done <"$lavapipe_lock" >"$list"
	if [ -s "$list" ]; then
		curl --parallel --parallel-max 6 --fail --silent --location --retry 3 --connect-timeout 20 --config "$list" 2>/dev/null || true
	fi
	rm -f "$list"
	while read -r name version sha256 _ path; do
		if [ -z "$path" ] || [ "$name" = "#" ]; then continue; fi
		deb=$debs/$sha256.deb
		if ! fetch "$debian_mirror/$path" "$sha256" "$deb"; then
			if [ "$fetch_gone" = 0 ]; then die_of_network; fi
			fetch_moved_package "$name" "$version" "$sha256" "$path" "$debs"
		fi
		into=$new/root
		if [ "$name" = libc6 ]; then into=$new/libc; fi
		dpkg-deb --extract "$deb" "$into" || die "could not unpack $deb: is the disk full? Delete that file and run the command again."
	done <"$lavapipe_lock"
	trim_lavapipe "$new"
	write_lavapipe_wrapper "$new"
	pins=$(lavapipe_pins)
	put_in_place "$new" "$prefix" "$pins${instead:+, but $index_is $instead}"
	rm -rf "$debs"
}

# Of 300 MB unpacked, what no program opens: other drivers and layers, documentation, character sets.
trim_lavapipe() {
	local lib=$1/root/usr/lib/$deb_triplet share=$1/root/usr/share
	find "$lib" -name 'libvulkan_*.so' ! -name libvulkan_lvp.so -delete
	find "$share/vulkan/icd.d" -name '*.json' ! -name lvp_icd.json -delete
	find "$share/vulkan/explicit_layer.d" -name '*.json' ! -name VkLayer_khronos_validation.json -delete
	rm -rf "$share/vulkan/implicit_layer.d" "$lib"/libVkLayer_INTEL_* "$lib"/libVkLayer_MESA_*
	rm -rf "$1/root/usr/bin" "$share/bug" "$share/lintian" "$share/man" "$share/locale" "$1/libc/usr/lib/$deb_triplet/gconv" "$1/libc/usr/share/locale"
	# Copyright files stay: this is other people's work.
	find "$share/doc" "$1/libc/usr/share/doc" -name '*changelog*' -delete
}
