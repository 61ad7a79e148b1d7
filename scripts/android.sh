# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# The parts of the headset's package, besides Rust: the target's standard library, a clang where there is no NDK (one
# dependency has C and assembler in it), and the libraries of others that go into the package. Sourced by ./run.
#
#   $MON3TR_CACHE/clang/run                    `run ARGS...` is clang with ARGS, under the same process id
#   $MON3TR_CACHE/android-parts/FILE           the libraries; parts.json beside them says what they are and where they are from
#   $MON3TR_CACHE/android-parts-qnn/FILE       those for the NPU, which only --with-qnn asks for
#   $MON3TR_CACHE/android-parts-rehearsal/FILE those that the rehearsal executes on this machine's processor

android_target=aarch64-linux-android
rehearsal_target=x86_64-linux-android
clang_lock=$repo/scripts/clang-$debian_arch.lock
android_parts_lock=$repo/scripts/android-parts.lock
maven=${MON3TR_MAVEN_MIRROR:-https://repo1.maven.org/maven2}
npm=https://registry.npmjs.org

# has_ndk: where the build looks for one, in its order (tools/android-native/src/native/route.rs).
has_ndk() {
	[ -n "${ANDROID_NDK_HOME:-}${ANDROID_NDK_ROOT:-}" ] || [ -n "$(ls -d "${ANDROID_HOME:-/nonexistent}"/ndk/*/ 2>/dev/null)" ]
}

install_android_target() { install_rust_target "$android_target"; }

install_rehearsal_target() { install_rust_target "$rehearsal_target"; }

# Raise this when what is unpacked, trimmed or written into the wrapper changes.
clang_pins() { lock_pins "$clang_lock" 1; }

clang_is_there() { [ -n "${MON3TR_CLANG:-}" ] || debs_are_ready "$MON3TR_CACHE/clang" "$(clang_pins)"; }

# clang starts itself again for a file of assembler, by what it takes for its own path, and looks for its headers beside that: through
# the locked dynamic linker that would be the dynamic linker's path.
install_clang() {
	local new=$MON3TR_CACHE/clang.new instead="" trust=signed
	say "Fetching clang $(locked_version "$clang_lock" clang-19) from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$clang_lock" "$new"
	find "$new/root/usr/lib/llvm-19/bin" "$new/root/usr/bin" \( -type f -o -type l \) ! -name clang -delete
	trim_documentation "$new"
	{
		cat <<-WRAPPER
			#!/bin/sh
			# Written by ./run: clang in the prefix this script lies in.
			here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
			lib=\$here/root/usr/lib/$deb_triplet
			clang=\$here/root/usr/lib/llvm-19
			case \${1:-} in
			-cc1*) set -- "\$clang/bin/clang" "\$@" ;;
			*) set -- "\$clang/bin/clang" -no-canonical-prefixes -resource-dir "\$clang/lib/clang/19" "\$@" ;;
			esac
		WRAPPER
		wrapper_tail "$clang_lock" "\"\$here/run\""
	} >"$new/run"
	chmod +x "$new/run"
	put_in_place "$new" "$MON3TR_CACHE/clang" "$(clang_pins)${instead:+, but $trust $instead}"
}

export_clang() { export MON3TR_CLANG=${MON3TR_CLANG:-$MON3TR_CACHE/clang/run}; }

# Of each set its own lines of the lock, so that a change to one does not fetch the other again. Raise the layout when what is
# unpacked changes.
android_parts_pins() {
	echo "$(awk -v set="$1" '/^#/ { next } $1 == "part" { on = ($2 == set) } on' "$android_parts_lock" | sha256sum | cut -d' ' -f1) layout 1"
}

# android_parts_folder SET
android_parts_folder() { echo "$MON3TR_CACHE/android-parts$([ "$1" = base ] || echo "-$1")"; }

android_parts_are_there() {
	case $1 in
	base) [ -n "${MON3TR_ANDROID_PARTS:-}" ] && return ;;
	qnn) [ -n "${MON3TR_ANDROID_PARTS_QNN:-}" ] && return ;;
	rehearsal) [ -n "${MON3TR_ANDROID_PARTS_REHEARSAL:-}" ] && return ;;
	esac
	is_stamped "$(android_parts_folder "$1")" "$(android_parts_pins "$1")"
}

install_android_parts() { install_android_set base; }

install_android_parts_qnn() { install_android_set qnn; }

install_android_parts_rehearsal() { install_android_set rehearsal; }

# install_android_set SET: its libraries, each from the first source that has it.
install_android_set() {
	local set=$1 prefix new word part="" for_npu="" version url sha256 member library archive done=1 why="" archives=() one
	prefix=$(android_parts_folder "$set")
	new=$prefix.new
	say "Fetching libraries for the headset from $maven"
	rm -rf "$new"
	mkdir -p "$new"
	while read -r word version url sha256 member library; do
		case $word in
		part)
			[ "$done" = 1 ] || lack_part "$part" "$why"
			part="" why=""
			if [ "$version" = "$set" ]; then
				part=$url for_npu=$sha256 done=0
			fi
			continue
			;;
		from) if [ -z "$part" ] || [ "$done" = 1 ]; then continue; fi ;;
		*) continue ;;
		esac
		url=${url/#MAVEN/$maven}
		url=${url/#NPM/$npm}
		archive=$MON3TR_CACHE/download/$sha256.${url##*.}
		if ! fetch "$url" "$sha256" "$archive"; then
			why+="${why:+; }$fetch_error"
			say "  $part: $fetch_error"
			continue
		fi
		archives+=("$archive")
		unpack_part "$archive" "$member" "$new" "$part" "$library" "$version" "$url" "$for_npu" ||
			die "could not unpack $part from $url (above is why): is the disk full?"
		say "  $part $version from $url"
		done=1
	done <"$android_parts_lock"
	[ "$done" = 1 ] || lack_part "$part" "$why"
	put_in_place "$new" "$prefix" "$(android_parts_pins "$set")"
	for one in "${archives[@]}"; do rm -f "$one"; done
}

lack_part() {
	die "$1, which the headset's package needs, is not available: $2. Check the network (a proxy is set with https_proxy=..., another mirror of Maven Central with MON3TR_MAVEN_MIRROR=...) and run the command again; what is already here is kept."
}

# unpack_part ARCHIVE MEMBER FOLDER FILE SHA256 VERSION URL FOR_NPU: FOLDER/FILE, and its entry in FOLDER/parts.json.
unpack_part() {
	python3 - "$@" <<-'PY'
		import hashlib, io, json, os, sys, tarfile, zipfile
		archive, members, folder, name, sha256, version, url, for_npu = sys.argv[1:]
		with open(archive, "rb") as file:
		    data = file.read()
		for member in members.split("!"):
		    if data[:2] == b"PK":
		        with zipfile.ZipFile(io.BytesIO(data)) as inner:
		            data = inner.read(member)
		    else:
		        with tarfile.open(fileobj=io.BytesIO(data)) as inner:
		            data = inner.extractfile(member).read()
		found = hashlib.sha256(data).hexdigest()
		if sha256 not in ("-", found):
		    sys.exit(f"{members} has SHA-256 {found}, not the {sha256} that was pinned")
		with open(os.path.join(folder, name), "wb") as file:
		    file.write(data)
		listed = os.path.join(folder, "parts.json")
		parts = []
		if os.path.exists(listed):
		    with open(listed, encoding="utf-8") as file:
		        parts = json.load(file)
		parts.append({"file": name, "version": version, "from": url, "sha256": found, "for_npu": for_npu == "npu"})
		with open(listed, "w", encoding="utf-8") as file:
		    json.dump(parts, file, indent=1)
	PY
}

export_android() {
	export MON3TR_ANDROID_PARTS=${MON3TR_ANDROID_PARTS:-$(android_parts_folder base)}
	if android_parts_are_there qnn; then export MON3TR_ANDROID_PARTS_QNN=${MON3TR_ANDROID_PARTS_QNN:-$(android_parts_folder qnn)}; fi
	if ! has_ndk; then export_clang; fi
}

# rehearsal_lacks: why the app for Android cannot be executed on this machine; fails where it can.
rehearsal_lacks() {
	[ "$debian_arch" = amd64 ] && return 1
	echo "the app's build for x86_64 is executed, and this machine is $(uname -m)"
}

export_rehearsal() {
	if ! has_ndk; then export_clang; fi
	export MON3TR_ANDROID_PARTS_REHEARSAL=${MON3TR_ANDROID_PARTS_REHEARSAL:-$(android_parts_folder rehearsal)}
}
