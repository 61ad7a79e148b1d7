# shellcheck shell=bash disable=SC2154 # run sets what is not assigned here
# Runs the workspace's tests and counts them. Sourced by ./run.
#
# A test that cannot run without a component prints `skipped: why` and passes (with CI=true it fails). Cargo hides what
# passing tests print, so they are run with --show-output: all of it goes to the log, the screen gets it without, and the
# skipped ones are listed at the end: none is skipped silently. In the same way tests tell what else of the machine's came between:
# `started again: why` for a program of others' that died, `too busy: why` for a measurement that others disturbed and that is made
# again, and `not judged: why` where they did so every time (with CI=true that fails).

run_tests() {
	local log=${CARGO_TARGET_DIR:-$repo/target}/run-test.log status=0 what=(--workspace) for_cargo=() for_tests=(--show-output)
	mkdir -p "$(dirname "$log")"
	while [ $# != 0 ]; do
		case $1 in
		# Options for the tests themselves come after it.
		--) for_tests+=("${@:2}") && break ;;
		# ./run has seen to it.
		--gpu) shift ;;
		--gpu=*) ;;
		-p* | --package | --package=* | --workspace | --all) what=() && for_cargo+=("$1") ;;
		*) for_cargo+=("$1") ;;
		esac
		if [ $# != 0 ]; then shift; fi
	done
	cargo test --manifest-path "$repo/Cargo.toml" "${what[@]}" --no-fail-fast "${for_cargo[@]}" -- "${for_tests[@]}" 2>&1 |
		tee "$log" |
		sed --unbuffered '/^successes:$/,/^\(failures:\|test result:\)/ { /^\(failures:\|test result:\)/! d }' || status=$?
	summarise_tests "$log"
	if [ "$status" != 0 ]; then
		say "Tests failed. The whole output is in $log"
	fi
	return "$status"
}

# summarise_tests LOG: the sum over cargo's `test result` lines, and every skipped test with its reason, and so on.
summarise_tests() {
	awk '
		/^test result:/ {
			for (i = 2; i <= NF; i++) {
				if ($i ~ /^passed/) passed += $(i - 1)
				if ($i ~ /^failed/) failed += $(i - 1)
				if ($i ~ /^ignored/) ignored += $(i - 1)
			}
		}
		/^---- .* stdout ----$/ { name = $2 }
		/^skipped: / { skipped++; reasons = reasons "  " name ": " $0 "\n" }
		/^(started again|too busy|not judged): / {
			if (/^s/) again++; else if (/^t/) busy++; else open++
			between = between "  " name ": " substr($0, 1, 200) "\n"
		}
		END {
			printf "\n%d tests ran: %d passed, %d failed; besides %d ignored, and %d of the passed skipped\n",
				passed + failed, passed, failed, ignored, skipped
			printf "%s", reasons
			if (between != "")
				printf "%d times a program of others was started again, %d measurements were disturbed and made again, %d tests could not be judged\n%s",
					again, busy, open, between
		}' "$1"
}
