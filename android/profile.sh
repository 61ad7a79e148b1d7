#!/usr/bin/env bash
# Profiles the app on a headset: installs it, lets it measure the demo avatar, and fetches the files that it wrote.
# docs/profile.md says what the files mean. Needs adb and a headset in developer mode; nothing else of this repository.
set -euo pipefail

repo=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd)
apk=$repo/mon3tr-quest3.apk
avatar=${MON3TR_CACHE:-$repo/.cache}/avatars/demo-60000-v3.m3a
seconds=60
out=$repo/out/profile-quest
serial=
placement=
install=1
# shellcheck source=android/headset.sh
. "$repo/android/headset.sh"

usage() {
	cat <<'HELP'
Usage: android/profile.sh [OPTIONS] [APK]

Installs APK [default: mon3tr-quest3.apk, where ./run apk leaves it] on the headset that adb sees, starts it to measure the demo avatar, waits, and fetches
profile.html, trace.json (for ui.perfetto.dev), profile.json and profile.txt, the table, which it prints. Wear the headset, or cover
the sensor between its lenses: it draws nothing while it is not worn.

  --seconds N        how long to measure, 5 to 3600 [default: 60]
  --placement SPEC   where stages run, as docs/profile.md has it (cpu,npu=nnapi) [default: the app's setting]
  --avatar FILE      the avatar to show [default: the demo avatar, which ./run demo or ./run bake leaves in .cache]
  --out FOLDER       where the files go [default: out/profile-quest]
  --device SERIAL    which headset, where there are several (adb devices lists them)
  --no-install       measure with the app that is installed
  -h, --help         this text
HELP
}

# wanted OPTION VALUE...: that there is a value.
wanted() { [ $# -ge 2 ] || die "$1 needs a value: see --help"; }

apk_is_given=0
while [ $# != 0 ]; do
	case $1 in
	-h | --help) usage && exit ;;
	--seconds) wanted "$@" && seconds=$2 && shift ;;
	--placement) wanted "$@" && placement=$2 && shift ;;
	--avatar) wanted "$@" && avatar=$2 && shift ;;
	--out) wanted "$@" && out=$2 && shift ;;
	--device) wanted "$@" && serial=$2 && shift ;;
	--no-install) install=0 ;;
	-*) die "there is no option $1: see --help" ;;
	*)
		[ "$apk_is_given" = 0 ] || die "one APK is enough: see --help"
		apk=$1 apk_is_given=1
		;;
	esac
	shift
done
# At most a million: the shell's arithmetic has an end, and a number that begins with 0 would be read as octal.
if [[ ! $seconds =~ ^[1-9][0-9]{0,3}$ ]] || [ "$seconds" -lt 5 ] || [ "$seconds" -gt 3600 ]; then
	die "--seconds $seconds is not a whole number of 5 to 3600"
fi
[[ $placement =~ ^[a-z=,-]*$ ]] || die "--placement $placement is none: docs/profile.md has them"
if [ "$install" = 1 ] && [ ! -f "$apk" ]; then
	die "there is no $apk: build it, name another APK, or measure with the installed one (--no-install)"
fi

[ -f "$avatar" ] || die "there is no avatar $avatar: run ./run demo once, or name another package with --avatar"

find_package
folder=$files/profile

# What the app said last, then the end.
die_with_log() {
	printf '\nThe last lines of its log:\n' >&2
	device logcat -d -t 2000 2>/dev/null | grep -E "mon3tr|$package|AndroidRuntime|DEBUG|libc " | tail -n 40 >&2 || true
	die "$1"
}

choose_device
if [ "$install" = 1 ]; then
	install_app "$apk"
elif [[ $(ask "pm path $package") != package:* ]]; then
	die "$package is not installed on $serial: leave --no-install out"
fi

# An earlier profile's file must not end this one.
device shell "am force-stop $package; rm -f $folder/finished" </dev/null >/dev/null || die "$serial does not answer"
device shell "mkdir -p $files" </dev/null >/dev/null || die "$serial lets adb not write to $files"
said=$(device push "$avatar" "$files/avatar.m3a" 2>&1) || die "adb could not copy $avatar: ${said##*$'\n'}"
device logcat -c 2>/dev/null || true
printf 'Measuring for %s s; keep the headset on\n' "$seconds"
said=$(device shell "am start -n $package/android.app.NativeActivity --es profile $seconds${placement:+ --es placement $placement}" </dev/null 2>&1) || said="Error: $said"
[[ $said != *Error* ]] || die "the app does not start: $(printf '%s' "$said" | grep -m 1 Error)"

# Besides measuring: loading, choosing where stages run, warming up, writing.
deadline=$((SECONDS + seconds + ${MON3TR_PROFILE_PATIENCE:-180}))
gone=0
until finished=$(ask "cat $folder/finished") && [ -n "$finished" ]; do
	# Several times in a row: right after `am start` there is no process yet.
	if [ -n "$(ask "pidof $package")" ]; then gone=0; else gone=$((gone + 1)); fi
	[ "$gone" -lt 5 ] || die_with_log "$package ended before it had measured: it crashed, or was closed"
	[ "$SECONDS" -lt "$deadline" ] || die_with_log "nothing was measured in $((seconds + ${MON3TR_PROFILE_PATIENCE:-180})) s: was the headset worn?"
	[ -n "$(adb devices | grep -F "$serial")" ] || die "$serial is gone: is the cable loose?"
	sleep "${MON3TR_PROFILE_POLL:-2}"
done
device shell "am force-stop $package" </dev/null >/dev/null || true
[ "$finished" = ok ] || die_with_log "the app could not measure: ${finished#failed: }"

mkdir -p "$out"
for file in profile.txt profile.html trace.json profile.json; do
	said=$(device pull "$folder/$file" "$out/$file" 2>&1) || die "cannot fetch $folder/$file: ${said##*$'\n'}"
done
cat "$out/profile.txt"
printf '\nwritten\n'
printf '  %s\n' "$out/profile.html" "$out/trace.json" "$out/profile.json"
