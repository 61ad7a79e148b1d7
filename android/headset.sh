# shellcheck shell=bash
# What the scripts that talk to a headset by adb share: which one it is, its shell, the app's package on it. Sourced by them; `repo` is the
# repository, and `serial` the headset that was asked for, or empty.

die() {
	printf '\nandroid/%s: %s\n' "${0##*/}" "$*" >&2
	exit 1
}

# find_package: sets `package`, the app's name, and `files`, its own folder on what Android calls external storage, which adb may read and write.
find_package() {
	local manifest=$repo/android/AndroidManifest.xml
	package=$(sed -n 's/^[[:space:]]*\(<manifest .*\)\{0,1\}package="\([A-Za-z0-9_.]*\)".*/\2/p' "$manifest" | head -n 1)
	[ -n "$package" ] || die "$manifest names no package"
	# shellcheck disable=SC2034 # read by the script that sources this
	files=/sdcard/Android/data/$package/files
}

# choose_device: sets `serial` to the one device, or checks the one that was asked for.
choose_device() {
	local line state=() others=() one
	command -v adb >/dev/null || die "adb is missing: install Android's platform tools (Debian: apt-get install adb)"
	adb start-server >/dev/null 2>&1 || die "adb does not start: $(adb start-server 2>&1 | tail -n 1)"
	while read -r line; do
		one=${line%%[[:space:]]*}
		[ -n "$one" ] || continue
		line=${line#"$one"}
		line=${line#"${line%%[![:space:]]*}"}
		others+=("$one")
		state+=("${line%%[[:space:]]*}")
	done < <(adb devices | tr -d '\r' | sed 1d)
	if [ ${#others[@]} = 0 ]; then
		die "adb sees no headset: connect it, turn on developer mode, and allow debugging in the headset"
	fi
	# adb's own variable, where no option names one.
	serial=${serial:-${ANDROID_SERIAL:-}}
	if [ -z "$serial" ]; then
		[ ${#others[@]} = 1 ] || die "adb sees several devices (${others[*]}): choose one with --device SERIAL"
		serial=${others[0]}
	fi
	for one in "${!others[@]}"; do
		if [ "${others[$one]}" != "$serial" ]; then continue; fi
		case ${state[$one]} in
		device) return ;;
		unauthorized) die "$serial does not trust this computer: put the headset on and allow debugging" ;;
		*) die "$serial is ${state[$one]}: connect it again, or restart it" ;;
		esac
	done
	die "adb sees no device $serial, but ${others[*]}"
}

device() { adb -s "$serial" "$@"; }

# ask COMMAND: what the headset's shell answers, without the carriage returns of old ones.
ask() { device shell "$1" </dev/null 2>/dev/null | tr -d '\r'; }

# install_app APK
install_app() {
	local said
	printf 'Installing %s on %s\n' "${1##*/}" "$serial"
	if ! said=$(device install -r "$1" 2>&1) || [[ $said == *Failure* ]]; then
		case $said in
		*UPDATE_INCOMPATIBLE*) die "the $package that is installed was signed with another key: adb -s $serial uninstall $package, then run this again" ;;
		*) die "adb could not install $1: ${said##*$'\n'}" ;;
		esac
	fi
}
