# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# The NATS server, through which the tests let several instances of `mon3tr serve` share their rooms: the machine's own, or one
# unpacked from the Debian packages that nats-server-ARCH.lock pins. Nothing is started. Sourced by ./run.
#
#   $MON3TR_CACHE/nats-server/run    the wrapper: `run ARGS...` is `nats-server ARGS...`, under the same process id

nats_server_lock=$repo/scripts/nats-server-$debian_arch.lock

# Raise this when what is unpacked, trimmed or written into the wrapper changes.
nats_server_layout=1

nats_server_pins() { echo "$(sha256sum <"$nats_server_lock" | cut -d' ' -f1) layout $nats_server_layout"; }

# nats_server_is_there: something to point MON3TR_NATS_SERVER at.
nats_server_is_there() {
	[ -n "${MON3TR_NATS_SERVER:-}" ] || command -v nats-server >/dev/null || debs_are_ready "$MON3TR_CACHE/nats-server" "$(nats_server_pins)"
}

install_nats_server() {
	local prefix=$MON3TR_CACHE/nats-server new=$MON3TR_CACHE/nats-server.new instead="" trust=signed
	say "Fetching nats-server $(locked_version "$nats_server_lock" nats-server) from $debian_mirror"
	rm -rf "$new"
	unpack_lock "$nats_server_lock" "$new"
	trim_documentation "$new"
	{
		cat <<WRAPPER
#!/bin/sh
# Written by ./run: the NATS server in the prefix this script lies in.
here=\$(cd "\$(dirname "\$0")" && pwd) || exit 1
lib=\$here/root/usr/lib/$deb_triplet
set -- "\$here/root/usr/sbin/nats-server" "\$@"
WRAPPER
		wrapper_tail "$nats_server_lock"
	} >"$new/run"
	chmod +x "$new/run"
	put_in_place "$new" "$prefix" "$(nats_server_pins)${instead:+, but $trust $instead}"
}

export_nats_server() {
	if [ -n "${MON3TR_NATS_SERVER:-}" ]; then return; fi
	MON3TR_NATS_SERVER=$(command -v nats-server) || MON3TR_NATS_SERVER=$MON3TR_CACHE/nats-server/run
	export MON3TR_NATS_SERVER
}
