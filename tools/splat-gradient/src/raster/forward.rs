//! A tile's picture.

use super::run::{Half, STOP, open, reached};
use crate::tiles::{RUN, RUNS, TILE, Tile};
use fearless_simd::{f32x8, prelude::*};

/// Blends the tile's splats into its pixels; its first pixel is at `at`, in a picture of `size`.
#[inline(always)]
pub(crate) fn blend<S: Simd>(simd: S, tile: &mut Tile, at: [usize; 2], size: [usize; 2]) {
    let (mut live, transmittance) = open(at, size);
    let zero = [[0.0; RUN]; RUNS];
    tile.pixels = [zero, zero, zero, transmittance];
    tile.blended = tile.splats.len();
    let [reds, greens, blues, transmittances] = &mut tile.pixels;
    for (count, splat) in tile.splats.iter().enumerate() {
        let meeting = reached(splat, at) & live;
        for half in 0..2 {
            let mut rows = (meeting >> (half * TILE)) & 0xFFFF;
            if rows == 0 {
                continue;
            }
            let met_half = Half::new(simd, splat, at[0] + half * RUN, at[1]);
            while rows != 0 {
                let row = rows.trailing_zeros() as usize % TILE;
                rows &= rows - 1;
                let run = half * TILE + row;
                let before = f32x8::load_array_ref(simd, &transmittances[run]);
                let met = met_half.meet(simd, row, before);
                let weight = met.alpha * before;
                let after = before - weight;
                let planes = [&mut *reds, &mut *greens, &mut *blues];
                for (plane, channel) in planes.into_iter().zip(splat.colour) {
                    let sum = f32x8::load_array_ref(simd, &plane[run]);
                    weight.mul_add(channel, sum).store_array(&mut plane[run]);
                }
                after.store_array(&mut transmittances[run]);
                if !after.simd_ge(STOP).any_true() {
                    live &= !(1 << run);
                }
            }
        }
        if live == 0 {
            tile.blended = count + 1;
            break;
        }
    }
}
