# shellcheck shell=bash disable=SC2154 # run and prepare.sh set what is not assigned here
# The SPIR-V validator, which a test runs over every compiled shader: the machine's own, or one unpacked from the Debian packages
# that spirv-val-ARCH.lock pins. Sourced by ./run.

spirv_val_lock=$repo/scripts/spirv-val-$debian_arch.lock

spirv_val_pins() { lock_pins "$spirv_val_lock" 1; }

spirv_val_is_there() { program_is_there MON3TR_SPIRV_VAL spirv-val "$(spirv_val_pins)"; }

install_spirv_val() { install_program spirv-val "$spirv_val_lock" spirv-tools usr/bin/spirv-val "$(spirv_val_pins)"; }

export_spirv_val() { export_program MON3TR_SPIRV_VAL spirv-val; }
