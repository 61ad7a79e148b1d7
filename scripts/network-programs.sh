# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# ip and nft, with which tests make routers with NAT in network namespaces of their own: the machine's own, or unpacked from the Debian
# packages that ip-ARCH.lock and nft-ARCH.lock pin. Nothing is run here. Sourced by ./run.

ip_lock=$repo/scripts/ip-$debian_arch.lock
nft_lock=$repo/scripts/nft-$debian_arch.lock

ip_pins() { lock_pins "$ip_lock" 1; }

nft_pins() { lock_pins "$nft_lock" 1; }

ip_is_there() { program_is_there MON3TR_IP ip "$(ip_pins)"; }

nft_is_there() { program_is_there MON3TR_NFT nft "$(nft_pins)"; }

install_ip() { install_program ip "$ip_lock" iproute2 usr/bin/ip "$(ip_pins)"; }

install_nft() { install_program nft "$nft_lock" nftables usr/sbin/nft "$(nft_pins)"; }

export_ip() { export_program MON3TR_IP ip; }

export_nft() { export_program MON3TR_NFT nft; }
