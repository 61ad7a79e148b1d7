# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# The NATS server, through which the tests let several instances of `mon3tr-dev serve` share their rooms: the machine's own, or one
# unpacked from the Debian packages that nats-server-ARCH.lock pins. Nothing is started. Sourced by ./run.

nats_server_lock=$repo/scripts/nats-server-$debian_arch.lock

nats_server_pins() { lock_pins "$nats_server_lock" 1; }

nats_server_is_there() { program_is_there MON3TR_NATS_SERVER nats-server "$(nats_server_pins)"; }

install_nats_server() { install_program nats-server "$nats_server_lock" nats-server usr/sbin/nats-server "$(nats_server_pins)"; }

export_nats_server() { export_program MON3TR_NATS_SERVER nats-server; }
