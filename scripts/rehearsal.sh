# shellcheck shell=bash disable=SC2154 # run sets what is not assigned here
# The headset's app: its package built and looked at (tools/mon3tr-dev/tests/apk), and its build for this machine's processor executed
# (tests/android-rehearsal). Sourced by ./run.
#
# Both take twenty minutes with their builds, so CI performs them where something changed that they build or execute. What that was when it last
# passed is kept beside the crate, in `rehearsed`: a line a path, with the hash of its tracked files, and a line each for the crates of others that the
# app is built from and for the profiles it is built by, so that what only desktop tools depend on rehearses nothing. A developer who changes the app
# rehearses it, and commits that file with the change; where that was forgotten, CI does it.

rehearsed=$repo/tests/android-rehearsal/rehearsed
rehearsal_paths=(android app link npu-runtime shaders-spirv splat-scene spmm3 tests/android-rehearsal tests/person tests/support tools/android-native tools/call-member tools/lip-sync
	tools/mon3tr-dev/src/apk tools/mon3tr-dev/tests/apk tools/motion-fit tools/profile-report tools/sender tools/sound-devices tools/spatial-sound tools/voice-processing xr-renderer)

# rehearsal_dependencies: the crates that the app and the rehearsal are built from, a line each, with versions and features
rehearsal_dependencies() {
	local tree=(cargo tree --locked --manifest-path "$repo/Cargo.toml" --edges normal,build --prefix none --format '{p} {f}')
	{
		"${tree[@]}" --package mon3tr-android --target aarch64-linux-android
		"${tree[@]}" --package android-rehearsal --target "$(uname -m)-unknown-linux-gnu"
	} | sed 's/ ([^)]*)//g' | LC_ALL=C sort -u
}

# rehearsal_profiles: how the app is built; `profile.android` inherits `profile.dev` without its table of packages
rehearsal_profiles() {
	awk '/^\[/ { wanted = /^\[profile\.(dev|release|android[^]]*)\]/ } wanted' "$repo/Cargo.toml"
}

# rehearsal_state: a line a path, and one each for dependencies and profiles
rehearsal_state() {
	local path hash
	for path in "${rehearsal_paths[@]}"; do
		# Its tests are performed with the others, not in the rehearsal.
		hash=$(cd "$repo" && git ls-files -z -- "$path" ':!tests/android-rehearsal/rehearsed' ":(exclude,glob)$path/**/tests/**" | LC_ALL=C sort -z |
			xargs -0 sha256sum | sha256sum | cut -c1-32)
		printf '%s %s\n' "$hash" "$path"
	done
	hash=$(rehearsal_dependencies | sha256sum | cut -c1-32)
	printf '%s %s\n' "$hash" dependencies
	hash=$(rehearsal_profiles | sha256sum | cut -c1-32)
	printf '%s %s\n' "$hash" profiles
}

# rehearsal_changes: what changed since it last passed, in one line
rehearsal_changes() {
	rehearsal_state | { grep -vxFf "$rehearsed" || true; } | cut -d' ' -f2 | paste -sd' '
}

# is_a_part ARGS...: a case, or a command with the rehearsal as its device, not the whole
is_a_part() {
	case " $* " in *" --case"* | *" --device "*) ;; *) return 1 ;; esac
}

# rehearse [--if-changed] ARGS...
rehearse() {
	local changes="" state arguments=()
	if [ "${1:-}" = --if-changed ]; then
		shift
		[ -f "$rehearsed" ] || : >"$rehearsed"
		changes=$(rehearsal_changes)
		if [ -z "$changes" ]; then
			say "The rehearsal of the headset's app is left out: ${rehearsal_paths[*]} are as they were when it last passed (${rehearsed#"$repo/"})"
			return
		fi
		say "The headset's app is rehearsed, because since that last passed these changed: $changes"
	fi
	while [ $# != 0 ]; do
		case $1 in
		# ./run has seen to it.
		--gpu) shift ;;
		--gpu=*) ;;
		*) arguments+=("$1") ;;
		esac
		if [ $# != 0 ]; then shift; fi
	done
	set -- "${arguments[@]}"
	# What is about to be built: an edit made meanwhile was not rehearsed.
	state=$(rehearsal_state)
	# One case alone is a developer's: the package waits for the whole.
	if ! is_a_part "$@"; then cargo test --manifest-path "$repo/Cargo.toml" --package mon3tr-dev --test apk -- --include-ignored; fi
	cargo build --manifest-path "$repo/Cargo.toml" --package mon3tr --package android-rehearsal
	"${CARGO_TARGET_DIR:-$repo/target}/debug/rehearse-android" "$@"
	if ! is_a_part "$@"; then printf '%s\n' "$state" >"$rehearsed"; fi
}
