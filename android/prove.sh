#!/usr/bin/env bash
# Tries on a headset what README and docs say of it, for an hour, and writes a page that says, row by row, what held. docs/android.md says what it needs.
# One step that fails is a row of the page; the others go on.
set -uo pipefail

repo=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd)
apk=$repo/mon3tr-quest3.apk
out=$repo/out/prove
serial=
minutes=60
short=0
rehearsal=0
arguments=("$@")
# The rehearsal, as the device, has an avatar and programs of its own.
avatar=${MON3TR_PROVE_AVATAR:-${MON3TR_CACHE:-$repo/.cache}/avatars/demo-60000-v3.m3a}
# Shares of packets that a call over a bad network loses, and its delay each way, ms.
loss=0.05 delay=20
# shellcheck source=android/headset.sh
. "$repo/android/headset.sh"

usage() {
	cat <<'HELP'
Usage: android/prove.sh [OPTIONS] [APK]

Installs APK [default: mon3tr-quest3.apk, where ./run apk leaves it] on the headset that adb sees, and tries for an hour what README and docs say of it: each
placement with each provider, one to four people, pauses, a call of several, a call that loses packets, heat and memory. All that it finds goes to out/prove, and
proof.html there says row by row which claim held. The exit status is 1 where one did not.

Server and senders run on this computer: headset and computer are in one network, and nothing keeps the headset from this computer's ports. Nobody has to wear
the headset, which is told that it is worn; it should lie where it sees a room.

What it changes on the headset: APK is installed and stays; the app is stopped and started; mon3tr.toml and avatar.m3a in its folder are replaced, and put back at the end; it may hear
its microphone meanwhile, in a call with this computer; the log is cleared for each step, and its buffer is 16 MB until the headset restarts; it sleeps and wakes.

  --short            seconds for each step, and only some of them: does all of it work here?
  --rehearsal        with the app's rehearsal on this machine as the device (docs/android.md); what concerns speed is not judged then
  --out FOLDER       where everything goes [default: out/prove]
  --device SERIAL    which headset, where there are several; also by ANDROID_SERIAL
  -h, --help         this text
HELP
}

apk_is_given=0
while [ $# != 0 ]; do
	case $1 in
	-h | --help) usage && exit ;;
	--short) short=1 ;;
	--rehearsal) rehearsal=1 ;;
	--out | --device)
		[ $# -ge 2 ] || die "$1 needs a value: see --help"
		if [ "$1" = --out ]; then out=$2; else serial=$2; fi
		shift
		;;
	-*) die "there is no option $1: see --help" ;;
	*)
		[ "$apk_is_given" = 0 ] || die "one APK is enough: see --help"
		apk=$1 apk_is_given=1
		;;
	esac
	shift
done

# In the rehearsal this script runs again, with an adb that asks it.
if [ "$rehearsal" = 1 ] && [ -z "${REHEARSAL_DEVICE:-}" ]; then
	exec "$repo/run" rehearse-android --device "$repo/android/prove.sh" "${arguments[@]}"
fi
[ "$rehearsal" = 1 ] || [ -f "$apk" ] || die "there is no $apk: build it (./run apk --release), or name another APK"
[ -f "$avatar" ] || die "there is no avatar $avatar: run ./run demo once"
command -v python3 >/dev/null || die "python3 is missing"

placements=(npu cpu-tail cpu gpu)
providers=(qnn nnapi xnnpack cpu)
measure=30 meet=90 talk=180 pauses=3 most_people=4
if [ "$short" = 1 ]; then
	placements=(cpu) providers=(xnnpack)
	measure=5 meet=8 talk=8 pauses=1 most_people=2 minutes=0
fi
poll=${MON3TR_PROVE_POLL:-1}
# How long a step waits for what it needs to be said, seconds.
patience=${MON3TR_PROVE_PATIENCE:-90}

find_package
choose_device
mkdir -p "$out" || die "cannot make $out"
if [ ! -f "$out/.proof" ] && [ -n "$(ls -A "$out")" ]; then die "$out has files that are no proof's: name an empty folder with --out"; fi
: >"$out/.proof"
# Of an earlier proof nothing is to count.
rm -rf "$out"/{log,profile,server,steps.tsv,samples.tsv,device.txt,desk.json,proof.html}
mkdir -p "$out/log" "$out/profile"
printf 'begin\n' >"$out/step"

# The command line program, as ./run has it, and that of developers.
mon3tr=${MON3TR_PROGRAM:-$repo/run}
mon3tr_dev=${MON3TR_DEV_PROGRAM:-$repo/run}

programs=()
# start_program NAME COMMAND...: in the background, what it says in log/NAME.txt, until the step ends
start_program() {
	local name=$1
	shift
	# Before it starts: what one of this name said in an earlier step is not to be read for its own.
	: >"$out/log/$name.txt"
	"$@" >"$out/log/$name.txt" 2>&1 </dev/null &
	programs+=($!)
}

# end_programs [FROM]: as Ctrl-C does, and waits for them
end_programs() {
	local one from=${1:-0}
	for one in "${programs[@]:$from}"; do kill -TERM "$one" 2>/dev/null; done
	for one in "${programs[@]:$from}"; do wait "$one" 2>/dev/null; done
	programs=("${programs[@]:0:$from}")
}

# word_after NAME WORDS: the word after them, once the program has said them; 1 where it does not. The first program to be started may be built before.
word_after() {
	local deadline=$((SECONDS + patience * 10)) found
	while [ "$SECONDS" -lt "$deadline" ]; do
		found=$(sed -n "s|.*$2\([^ ']*\).*|\1|p" "$out/log/$1.txt" 2>/dev/null | head -n 1)
		if [ -n "$found" ]; then
			printf '%s' "$found"
			return
		fi
		if ! kill -0 "${programs[-1]}" 2>/dev/null; then break; fi
		sleep 0.2
	done
	return 1
}

why=
fail() {
	why=$*
	return 1
}

# app_says TEXT TIMES: waits until the app's log has it so often
app_says() {
	local deadline=$((SECONDS + patience)) found
	while :; do
		found=$(device logcat -d -s mon3tr 2>/dev/null | grep -cF -- "$1")
		[ "$found" -lt "$2" ] || return 0
		[ -n "$(ask "pidof $package")" ] || { fail "the app ended while \"$1\" was waited for" || return; }
		[ "$SECONDS" -lt "$deadline" ] || { fail "the app did not say \"$1\" ($2 times, but $found) within $patience s" || return; }
		sleep "$poll"
	done
}

# open_app LINE...: starts it with these lines as its settings file, which no link of strangers is asked about
open_app() {
	local said
	printf '%s\n' "$@" >"$out/mon3tr.toml"
	said=$(device push "$out/mon3tr.toml" "$files/mon3tr.toml" 2>&1) || { fail "adb could not copy the settings: $said" || return; }
	said=$(ask "am start -S -n $package/android.app.NativeActivity")
	[[ $said != *Error* ]] || fail "the app does not start: $said"
}

# step NAME FUNCTION ARGS...: does it, keeps the app's log of it, and notes how it went
step() {
	local name=$1 begun=$SECONDS result=done
	shift
	why=
	printf '%s\n' "$name" >"$out/step"
	printf '%6d s  %s\n' "$SECONDS" "$name"
	device logcat -c 2>/dev/null
	"$@" || result=failed
	[ "$result" = done ] || printf '          failed: %s\n' "$why"
	device logcat -d -s mon3tr >"$out/log/$name.txt" 2>/dev/null
	end_programs "$kept"
	device shell "am force-stop $package" </dev/null >/dev/null 2>&1
	printf '%s\t%s\t%s\t%s\t%s\n' "$name" "$result" "$begun" "$SECONDS" "${why//[$'\t\n']/ }" >>"$out/steps.tsv"
}

# skip NAME WHY
skip() { printf '%s\tskipped\t%s\t%s\t%s\n' "$1" "$SECONDS" "$SECONDS" "$2" >>"$out/steps.tsv"; }

install_step() {
	[ "$rehearsal" = 0 ] || return 0
	local said
	said=$(install_app "$apk" 2>&1) || fail "${said##*: }"
}

profile_step() { # SPEC
	local log=$out/log/profiling-$1.txt
	"$repo/android/profile.sh" --no-install --device "$serial" --seconds "$measure" --placement "$1" --avatar "$avatar" --out "$out/profile/$1" >"$log" 2>&1 ||
		fail "$(tail -n 1 "$log" | sed 's/^[^:]*: //')"
}

# senders N: that many people, each with a room; sets `links`
senders() {
	local one link
	links=()
	[ -n "$server" ] || { fail "there is no server: $server_lacks" || return; }
	for one in $(seq "$1"); do
		start_program "sender-$one" "$mon3tr" send --server "$server" --owner-token "@$out/server/owner-token" --avatar "$avatar"
		link=$(word_after "sender-$one" "mon3tr receive '*") || { fail "no sender: $(tail -n 1 "$out/log/sender-$one.txt")" || return; }
		links+=("$link")
	done
}

# rooms LINK...: the line of the settings file
rooms() { printf 'room = [%s]' "$(printf '"%s", ' "$@")"; }

people_step() { # N SECONDS
	senders "$1" || return
	open_app "$(rooms "${links[@]}")" || return
	app_says "joined (session" "$1" || return
	sleep "$2"
	# The app says what it measured once they have hung up.
	end_programs "$kept"
	app_says "a call of " "$1"
}

pause_step() {
	local one
	senders 1 || return
	open_app "$(rooms "${links[@]}")" || return
	app_says "splatting by" 1 || return
	for one in $(seq "$pauses"); do
		sleep 3
		ask "input keyevent KEYCODE_SLEEP"
		sleep 5
		ask "input keyevent KEYCODE_WAKEUP"
		app_says "pictures are back" "$one" || return
	done
	end_programs "$kept"
	app_says "a call of " 1
}

loss_step() {
	local front
	senders 1 || return
	start_program network "$mon3tr_dev" netlab --before "${server#http://}" --loss "$loss" --delay "$delay"
	front=$(word_after network "viewers join at ") || { fail "no network that loses packets: $(tail -n 1 "$out/log/network.txt")" || return; }
	open_app "$(rooms "${links[0]/"$server"/"$front"}")" || return
	app_says "joined (session" 1 || return
	sleep "$talk"
	# The sender alone: its goodbye is to come through.
	kill -TERM "${programs[$kept]}"
	app_says "a call of " 1
}

call_step() {
	local link
	[ -n "$server" ] || { fail "there is no server: $server_lacks" || return; }
	device push "$avatar" "$files/avatar.m3a" >/dev/null 2>&1 || { fail "adb could not copy the avatar" || return; }
	start_program desk "$mon3tr" call --server "$server" --owner-token "@$out/server/owner-token" --avatar "$avatar" --name Desk --display none --json "$out/desk.json"
	link=$(word_after desk "mon3tr call '*") || { fail "no call: $(tail -n 1 "$out/log/desk.txt")" || return; }
	open_app "call = \"$link\"" 'name = "Headset"' || return
	app_says "Desk has joined" 1 || return
	sleep "$talk"
	end_programs "$kept"
	app_says "Desk has left" 1
}

# sample: a line now and then while anything runs: seconds, step, thermal status, the warmest skin, the app's memory in kB; a blank where nothing is said
sample() {
	local heat status skin memory
	while :; do
		heat=$(ask "dumpsys thermalservice")
		status=$(sed -n 's/.*Thermal Status: *\([0-9]*\).*/\1/p' <<<"$heat" | head -n 1)
		skin=$(sed -n 's/.*mValue=\([0-9.]*\).*mType=3,.*/\1/p' <<<"$heat" | sort -rn | head -n 1)
		# It stops the app for a moment: not where rates and latencies are measured.
		memory=
		case $(cat "$out/step") in profile-*) ;; *) memory=$(ask "dumpsys meminfo $package" | sed -n 's/.*TOTAL PSS: *\([0-9]*\).*/\1/p; s/^ *TOTAL  *\([0-9]*\).*/\1/p' | head -n 1) ;; esac
		printf '%s\t%s\t%s\t%s\t%s\n' "$SECONDS" "$(cat "$out/step")" "$status" "$skin" "$memory" >>"$out/samples.tsv"
		sleep "$((short ? 1 : 5))"
	done
}

# What belongs to whoever owns the headset is put back.
owned=(mon3tr.toml avatar.m3a)
kept=0
sampler=
may_hear=1
leave() {
	local one
	trap - EXIT INT TERM
	[ -z "$sampler" ] || kill "$sampler" 2>/dev/null
	end_programs
	for one in "${owned[@]}"; do
		if [ -f "$out/$one.before" ]; then
			if device push "$out/$one.before" "$files/$one" >/dev/null 2>&1; then
				rm -f "$out/$one.before"
			else
				printf '%s: %s is not put back: it is in %s; the next proof with this --out puts it back\n' "${0##*/}" "$one" "$out/$one.before" >&2
			fi
		elif [ -f "$out/$one.absent" ]; then
			device shell "rm -f $files/$one" </dev/null >/dev/null 2>&1 && rm -f "$out/$one.absent"
		fi
	done
	ask "am broadcast -a com.oculus.vrpowermanager.automation_disable" >/dev/null
	[ "$may_hear" != 0 ] || ask "pm revoke $package android.permission.RECORD_AUDIO" >/dev/null
	rm -f "$out/mon3tr.toml" "$out/step"
	rm -rf "$out/server"
}
for one in "${owned[@]}"; do
	# Of a proof that was stopped in between, they are here still.
	if [ -f "$out/$one.before" ] || [ -f "$out/$one.absent" ]; then continue; fi
	if said=$(device pull "$files/$one" "$out/$one.part" 2>&1); then
		mv "$out/$one.part" "$out/$one.before"
	elif [[ $said == *"does not exist"* || $said == *"No such file"* ]]; then
		: >"$out/$one.absent"
	else
		die "adb could not copy the headset's $one, which this would replace: ${said##*$'\n'}"
	fi
done
trap leave EXIT
trap 'exit 130' INT TERM

{
	for one in ro.product.model ro.build.version.release ro.build.version.sdk ro.build.fingerprint; do
		printf '%s=%s\n' "$one" "$(ask "getprop $one")"
	done
	printf 'rehearsal=%s\nshort=%s\nloss=%s\npauses=%s\nmost_people=%s\n' "$rehearsal" "$short" "$loss" "$pauses" "$most_people"
	printf 'commit=%s\n' "$(git -C "$repo" rev-parse HEAD 2>/dev/null)"
	if [ "$rehearsal" = 0 ]; then printf 'apk_bytes=%s\n' "$(wc -c <"$apk")"; fi
} >"$out/device.txt"

device logcat -G 16M >/dev/null 2>&1
step install install_step
device shell "mkdir -p $files" </dev/null >/dev/null 2>&1
# Taken back at the end where the wearer has not given it before.
may_hear=$(ask "dumpsys package $package" | grep -c 'android.permission.RECORD_AUDIO: granted=true')
ask "pm grant $package android.permission.RECORD_AUDIO" >/dev/null
# Worn, whether it is or not.
ask "am broadcast -a com.oculus.vrpowermanager.prox_close" >/dev/null
sample &
sampler=$!
disown "$sampler"

if [ "$short" = 1 ]; then skip profile-auto "left out by --short"; else step profile-auto profile_step auto; fi
for placement in npu cpu-tail cpu gpu; do
	for provider in qnn nnapi xnnpack cpu; do
		if [[ " ${placements[*]} " == *" $placement "* && " ${providers[*]} " == *" $provider "* ]]; then
			step "profile-$placement,npu=$provider" profile_step "$placement,npu=$provider"
		else
			skip "profile-$placement,npu=$provider" "left out by --short"
		fi
	done
done

if [ "$short" = 1 ]; then skip profile-gpu-alone "left out by --short"; else step profile-gpu-alone profile_step gpu-alone; fi

# The computer's address in the headset's network.
headset=$(ask "ip route" | sed -n 's/.* dev wlan.* src \([0-9.]*\).*/\1/p' | head -n 1)
server='' server_lacks="the headset has no address in a Wi-Fi network"
if [ -n "$headset" ]; then
	address=$(python3 -c 'import socket, sys; s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.connect((sys.argv[1], 9)); print(s.getsockname()[0])' "$headset")
	case $address in 127.*) insecure=() ;; *) insecure=(--insecure) ;; esac
	start_program server "$mon3tr" serve --listen "$address:0" --data "$out/server" "${insecure[@]}"
	server=$(word_after server "serving on ") || server_lacks=$(tail -n 1 "$out/log/server.txt")
	kept=${#programs[@]}
fi

for people in 1 2 3 4; do
	if [ "$people" -le "$most_people" ]; then step "people-$people" people_step "$people" "$meet"; else skip "people-$people" "left out by --short"; fi
done
step pause pause_step
step call call_step
if [ "$rehearsal" = 1 ] && [ -z "${MON3TR_DEV_PROGRAM:-}" ]; then
	skip loss "mon3tr-dev is not built"
else
	step loss loss_step
fi
rest=$((minutes * 60 - SECONDS))
if [ "$short" = 1 ]; then
	skip hour "left out by --short"
else
	step hour people_step 1 "$((rest > 60 ? rest : 60))"
fi

leave
python3 "$repo/android/prove-page.py" "$out"
