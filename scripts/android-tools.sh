# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# Android's own programs for packages: aapt2 and apksigner make the headset's, and tests check it with these, aapt and zipalign. Unpacked
# from the Debian packages that android-tools-ARCH.lock pins, and Java for apksigner: the machine's own if it is new enough, else from
# java-ARCH.lock. Sourced by ./run.
#
#   $MON3TR_CACHE/android-tools/aapt, aapt2, zipalign, apksigner   each the program of that name; the last through $MON3TR_JAVA
#   $MON3TR_CACHE/android-tools/lib/*.jar                          apksigner's classes, where an SDK's build-tools have them too
#   $MON3TR_CACHE/android-tools/framework-res.apk                  Android's own resources, which aapt2 links against
#   $MON3TR_CACHE/java/run                                         `run ARGS...` is java with ARGS, under the same process id

android_tools_lock=$repo/scripts/android-tools-$debian_arch.lock
java_lock=$repo/scripts/java-$debian_arch.lock
java_oldest=17

# Raise these when what is unpacked, trimmed or written into the wrappers changes.
android_tools_pins() { lock_pins "$android_tools_lock" 2; }
java_pins() { lock_pins "$java_lock" 1; }

# has_sdk: an Android SDK that packages are made with (tools/mon3tr-dev/src/apk/tools.rs), and the Java that it needs.
has_sdk() {
	local sdk
	machine_has_java || return 1
	for sdk in "${ANDROID_HOME:-}" "${ANDROID_SDK_ROOT:-}"; do
		[ -n "$sdk" ] || continue
		# Releases only: their names are numbers.
		if find "$sdk"/build-tools -mindepth 1 -maxdepth 1 -regex '.*/[0-9.]+' -exec test -e {}/lib/apksigner.jar -a -e {}/aapt2 \; -print 2>/dev/null | grep -q . &&
			find "$sdk"/platforms -mindepth 1 -maxdepth 1 -regex '.*/android-[0-9.]+' -exec test -e {}/android.jar \; -print 2>/dev/null | grep -q .; then return; fi
	done
	return 1
}

android_tools_are_there() { [ -n "${MON3TR_ANDROID_TOOLS:-}" ] || debs_are_ready "$MON3TR_CACHE/android-tools" "$(android_tools_pins)"; }

java_is_there() { [ -n "${MON3TR_JAVA:-}" ] || machine_has_java || debs_are_ready "$MON3TR_CACHE/java" "$(java_pins)"; }

# machine_has_java: a java that runs, of $java_oldest or newer; `java -version` says `openjdk version "17.0.15"`.
machine_has_java() {
	local have
	command -v java >/dev/null || return 1
	have=$(java -version 2>&1 | sed -n 's/.* version "\([0-9]*\).*/\1/p' | head -n 1)
	[ -n "$have" ] && [ "$have" -ge "$java_oldest" ]
}

install_android_tools() {
	local prefix=$MON3TR_CACHE/android-tools new=$MON3TR_CACHE/android-tools.new instead="" trust=signed one
	say "Fetching apksigner $(locked_version "$android_tools_lock" apksigner), aapt, aapt2, zipalign and Android's resources from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$android_tools_lock" "$new"
	trim_documentation "$new"
	for one in aapt aapt2 zipalign; do
		{
			cat <<-WRAPPER
				#!/bin/sh
				# Written by ./run: $one in the prefix this script lies in.
				here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
				lib=\$here/root/usr/lib/$deb_triplet
				lib=\$lib:\$lib/android:\$here/root/usr/lib:\$here/root/usr/lib/7zip
				set -- "\$here/root/usr/lib/android-sdk/build-tools/debian/$one" "\$@"
			WRAPPER
			wrapper_tail "$android_tools_lock"
		} >"$new/$one"
		chmod +x "$new/$one"
	done
	cat >"$new/apksigner" <<-'WRAPPER'
		#!/bin/sh
		# Written by ./run: apksigner in the prefix this script lies in.
		here=$(cd "$(dirname "$0")" && pwd) || exit 1
		jars=$here/root/usr/share/java
		exec "${MON3TR_JAVA:-java}" -cp "$jars/apksigner.jar:$jars/apksig.jar" com.android.apksigner.ApkSignerTool "$@"
	WRAPPER
	chmod +x "$new/apksigner"
	ln -s root/usr/share/java "$new/lib"
	ln -s root/usr/share/android-framework-res/framework-res.apk "$new/framework-res.apk"
	put_in_place "$new" "$prefix" "$(android_tools_pins)${instead:+, but $trust $instead}"
}

install_java() {
	local prefix=$MON3TR_CACHE/java new=$MON3TR_CACHE/java.new instead="" trust=signed home
	say "Fetching Java $(locked_version "$java_lock" openjdk-21-jre-headless) from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$java_lock" "$new"
	trim_documentation "$new"
	home=usr/lib/jvm/java-21-openjdk-$debian_arch
	[ -x "$new/root/$home/bin/java" ] || die "Debian's packages of Java have no $home/bin/java any more: scripts/android-tools.sh has to follow them"
	rm -rf "$new/root/$home/legal" "$new/root/$home/man"
	relink_java "$new/root" "$new/root/$home"
	{
		cat <<-WRAPPER
			#!/bin/sh
			# Written by ./run: java in the prefix this script lies in.
			here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
			home=\$here/root/$home
			lib=\$home/lib:\$home/lib/server:\$here/root/usr/lib/$deb_triplet
			set -- "\$home/bin/java" "\$@"
		WRAPPER
		wrapper_tail "$java_lock"
	} >"$new/run"
	chmod +x "$new/run"
	put_in_place "$new" "$prefix" "$(java_pins)${instead:+, but $trust $instead}"
}

# relink_java ROOT HOME: Debian keeps Java's configuration in /etc and links to it; here the files take the links' places.
relink_java() {
	local link target
	find "$2" -type l | while read -r link; do
		target=$1$(readlink "$link")
		case $(readlink "$link") in
		/etc/*) if [ -f "$target" ]; then cp --remove-destination "$target" "$link"; else rm "$link"; fi ;;
		esac
	done
	rm -rf "$1/etc"
}

export_android_tools() {
	export MON3TR_ANDROID_TOOLS=${MON3TR_ANDROID_TOOLS:-$MON3TR_CACHE/android-tools}
	if [ -z "${MON3TR_JAVA:-}" ]; then
		if machine_has_java; then MON3TR_JAVA=$(command -v java); else MON3TR_JAVA=$MON3TR_CACHE/java/run; fi
		export MON3TR_JAVA
	fi
}
