#!/usr/bin/env bash
# What every shader costs on the Quest 3's GPU, as a Markdown table, without a headset; ARGS go to the program (--help lists them).
# What is committed of it is tools/adreno-table/table.md.
set -euo pipefail

repo=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.." && pwd)
# shellcheck source=scripts/prepare.sh
. "$repo/scripts/prepare.sh"

if why=$(adreno_lacks); then die "$why"; fi
check_tools
if [ ${#missing_debs[@]} != 0 ]; then install_debs; fi
if ! adreno_is_there; then
	exec 9>"$MON3TR_CACHE/.lock"
	flock 9
	adreno_is_there || install_adreno
	exec 9>&-
fi
export_adreno

cargo build --quiet --manifest-path "$repo/Cargo.toml" --package adreno-table
exec "$MON3TR_ADRENO/run" "${CARGO_TARGET_DIR:-$repo/target}/debug/adreno-table" "$@"
