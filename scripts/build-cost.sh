#!/usr/bin/env bash
# The cost of a cold build: the number of crates, CPU seconds in all, and the crates that take most of them.
# Usage: scripts/build-cost.sh [ARGS FOR cargo build]   [default: what `./run demo` builds]
# Builds into a new folder, which is removed afterwards. CPU seconds hardly depend on what else the machine does, wall time does.
set -euo pipefail

# As cargo's wrapper of rustc: runs it and notes what it took.
if [ -n "${MON3TR_BUILD_COST_LOG:-}" ]; then
	status=0
	"$@" || status=$?
	name=-
	for ((at = 1; at <= $#; at++)); do
		if [ "${!at}" = --crate-name ]; then
			next=$((at + 1))
			name=${!next}
		fi
	done
	# The second line of `times` is of the processes that were waited for; a pipe would make it that of another shell.
	times >"$MON3TR_BUILD_COST_LOG.$$"
	printf '%s %s\n' "$name" "$(tail -n 1 "$MON3TR_BUILD_COST_LOG.$$")" >>"$MON3TR_BUILD_COST_LOG"
	exit "$status"
fi

repo=$(cd "$(dirname "$0")/.." && pwd)
what=("$@")
if [ $# = 0 ]; then what=(--package mon3tr --bin mon3tr --release); fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
log=$folder/crates
: >"$log"
TIMEFORMAT='%U %S %R'
{
	time MON3TR_BUILD_COST_LOG=$log RUSTC_WRAPPER=$repo/scripts/build-cost.sh CARGO_TARGET_DIR=$folder/target CARGO_INCREMENTAL=0 \
		cargo build --manifest-path "$repo/Cargo.toml" "${what[@]}" 2>"$folder/cargo" >&2
} 2>"$folder/time" || {
	cat "$folder/cargo" >&2
	exit 1
}
read -r user system wall <"$folder/time"
awk -v of_user="$user" -v of_system="$system" -v wall="$wall" -v what="${what[*]}" '
	function seconds(text, parts) {
		split(text, parts, /[ms]/)
		return parts[1] * 60 + parts[2]
	}
	# What cargo asks of rustc before it builds anything has no name; a build script is of the crate that it builds.
	$1 != "-" && $1 != "___" {
		cpu[$1] += seconds($2) + seconds($3)
		if ($1 !~ /^build_script_/) crates[$1] = 1
	}
	END {
		for (name in crates) count++
		printf "cargo build %s, cold: %d crates, %.0f CPU seconds (%.1f minutes), of them build scripts and C %.0f; %.0f s of wall time\n",
			what, count, of_user + of_system, (of_user + of_system) / 60, of_user + of_system - sum(), wall
		for (name in cpu) printf "%8.1f  %s\n", cpu[name], name | "sort -rn | head -30"
	}
	function sum(name, all) {
		for (name in cpu) all += cpu[name]
		return all
	}' "$log"
