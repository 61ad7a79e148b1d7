//! Shaders that have to find the same in floats.

use shaders_spirv::{BIN_COUNT, BIN_EMIT, Shader};

const OP_DECORATE: u32 = 71;
const NO_CONTRACTION: u32 = 42;

/// How many results of a shader no compiler may join with others.
fn uncontracted(shader: &Shader) -> usize {
    let mut left = &shader.words[5..];
    let mut found = 0;
    while let [head, ..] = *left {
        let (length, opcode) = ((head >> 16) as usize, head & 0xffff);
        found += usize::from(opcode == OP_DECORATE && left[2] == NO_CONTRACTION);
        left = &left[length.max(1)..];
    }
    found
}

#[test]
fn who_counts_and_who_lists_compute_outlines_to_the_bit() {
    let [count, emit] = [&BIN_COUNT, &BIN_EMIT].map(uncontracted);
    // Each sum, difference, product and quotient of an outline and its columns, the whole numbers' among them or not.
    assert!(count >= 30, "{count}");
    assert_eq!(count, emit, "counted and listed");
}
