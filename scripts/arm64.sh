# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# Building and running tests for arm64, the headset's processor, on another machine: Rust's standard library for it from rustup,
# linked by Rust's own linker against the C library that arm64-amd64.lock pins, and run by QEMU from there; the C and assembler of
# dependencies by the clang that compiles them for Android. Sourced by ./run.
#
#   $MON3TR_CACHE/arm64/root      the packages' files; of QEMU only what runs arm64 programs
#   $MON3TR_CACHE/arm64/cc        clang for arm64, with that C library's headers
#   $MON3TR_CACHE/arm64/ld.lld    the linker, told where the C library is (rustc knows its kind by this name)
#   $MON3TR_CACHE/arm64/run       runs an arm64 program: `run PROGRAM ARGS...`

arm64_lock=$repo/scripts/arm64-amd64.lock
arm64_target=aarch64-unknown-linux-gnu

# Raise the number when what is unpacked or written changes.
arm64_pins() { lock_pins "$arm64_lock" 2; }

arm64_is_there() { debs_are_ready "$MON3TR_CACHE/arm64" "$(arm64_pins)"; }

# arm64_lacks: why it cannot be set up here, if it cannot.
arm64_lacks() {
	if [ "$debian_arch" != amd64 ]; then
		echo "this is an arm64 machine: ./run test runs the same tests"
	elif ! command -v dpkg-deb >/dev/null; then
		echo "dpkg-deb, which unpacks QEMU's Debian packages, is missing: install dpkg"
	elif ! rust_target_is_there "$arm64_target" && ! command -v rustup >/dev/null; then
		echo "Rust's standard library for $arm64_target is missing, and so is rustup, which adds it: see https://rustup.rs"
	elif [ ! -x "$(arm64_lld)" ]; then
		echo "this Rust comes without its own linker, $(arm64_lld): use the one of https://rustup.rs"
	else
		return 1
	fi
}

arm64_lld() { (cd "$repo" && echo "$(rustc --print sysroot)/lib/rustlib/$(rustc -vV | sed -n 's/^host: //p')/bin/rust-lld"); }

install_arm64_std() { install_rust_target "$arm64_target"; }

install_arm64() {
	local prefix=$MON3TR_CACHE/arm64 new=$MON3TR_CACHE/arm64.new instead="" trust=signed
	say "Fetching QEMU $(locked_version "$arm64_lock" qemu-user) and arm64's C library from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$arm64_lock" "$new"
	find "$new/root/usr/bin" -type f ! -name qemu-aarch64 -delete
	rm -rf "$new/root/usr/share/qemu" "$new/root/usr/libexec"
	trim_documentation "$new"
	# Rust asks for it by this name, which only the C compiler's packages have.
	ln -s libgcc_s.so.1 "$new/root/usr/aarch64-linux-gnu/lib/libgcc_s.so"
	cat >"$new/ld.lld" <<'WRAPPER'
#!/bin/sh
# Written by ./run: Rust's linker, with the start files and the place of arm64's C library, which a C compiler would add.
here=$(cd "$(dirname "$0")" && pwd) || exit 1
lib=$here/root/usr/aarch64-linux-gnu/lib
host=$(rustc -vV | sed -n 's/^host: //p')
exec "$(rustc --print sysroot)/lib/rustlib/$host/bin/rust-lld" -flavor gnu --sysroot="$here/root" -L "$lib" \
	-dynamic-linker /lib/ld-linux-aarch64.so.1 "$lib/Scrt1.o" "$lib/crti.o" "$@" "$lib/crtn.o"
WRAPPER
	cat >"$new/cc" <<'WRAPPER'
#!/bin/sh
# Written by ./run: clang for arm64.
here=$(cd "$(dirname "$0")" && pwd) || exit 1
exec "${MON3TR_CLANG:-$here/../clang/run}" --target=aarch64-linux-gnu -isystem "$here/root/usr/aarch64-linux-gnu/include" "$@"
WRAPPER
	cat >"$new/run" <<'WRAPPER'
#!/bin/sh
# Written by ./run: an arm64 program in QEMU, on a processor that has NEON and nothing newer: nothing newer may be relied on.
here=$(cd "$(dirname "$0")" && pwd) || exit 1
exec "$here/root/usr/bin/qemu-aarch64" -cpu cortex-a53 -L "$here/root/usr/aarch64-linux-gnu" "$@"
WRAPPER
	chmod +x "$new/cc" "$new/ld.lld" "$new/run"
	put_in_place "$new" "$prefix" "$(arm64_pins)${instead:+, but $trust $instead}"
}

# export_arm64 CACHE: by the path that cargo can read. Any archiver will do: Rust writes the index itself.
export_arm64() {
	export CC_aarch64_unknown_linux_gnu=$1/arm64/cc AR_aarch64_unknown_linux_gnu=ar
	export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=$1/arm64/ld.lld
	export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER=$1/arm64/run
}
