# shellcheck shell=bash disable=SC2154 # run sets what is not assigned here
# Builds and runs the program that has a sub-command. Sourced by ./run.

# What a first build takes, as scripts/build-cost.sh measured it: crates, and minutes of one core.
declare -A first_build=([mon3tr]="355 16" [mon3tr-dev]="400 20")

# program_of COMMAND: the program that has it. What developers and operators need is not built for a first picture.
program_of() {
	case $1 in
	serve | relay | forwarder | audience | canary | bench | netlab | soak | capture | reconstruct | eval | apk) echo mon3tr-dev ;;
	*) echo mon3tr ;;
	esac
}

# say_first_build PROGRAM: one line on how long it takes, unless it was built before.
say_first_build() {
	local crates minutes cores
	if [ -e "${CARGO_TARGET_DIR:-$repo/target}/release/$1" ]; then return; fi
	read -r crates minutes <<<"${first_build[$1]}"
	cores=$(nproc)
	say "First build of $1: $crates crates, about $(((minutes + cores - 1) / cores)) minutes on $cores cores; cargo shows how far it is"
}

# run_program COMMAND ARGS...
run_program() {
	local program
	program=$(program_of "$1")
	say_first_build "$program"
	cargo build --release --manifest-path "$repo/Cargo.toml" --package "$program" --bin "$program" || exit
	# Quiet: it would print the whole command line, which may have a link or a token.
	exec cargo run --quiet --release --manifest-path "$repo/Cargo.toml" --package "$program" --bin "$program" -- "$@"
}
