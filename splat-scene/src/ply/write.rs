//! A scene as the PLY file that the 3DGS trainer would write for it, for other programs to read.

use std::convert::Infallible;
use std::io::{self, Write};

use crate::{Scene, Splat, frame};

impl Scene {
    /// Writes the scene in 3DGS' standard PLY layout: binary, COLMAP's axes, all properties `float`, with the normals
    /// (zero) that some readers expect. Opacities of exactly 0 and 1 become the nearest finite logit.
    ///
    /// # Errors
    /// What `out` says; give it a buffer, as each Gaussian is written on its own.
    pub fn write_ply(&self, out: &mut impl Write) -> io::Result<()> {
        self.ply_pieces(|piece| out.write_all(piece))
    }

    /// The bytes of [`Self::write_ply`].
    pub fn to_ply(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let Ok(()) = self.ply_pieces(|piece| -> Result<(), Infallible> {
            bytes.extend_from_slice(piece);
            Ok(())
        });
        bytes
    }

    /// Hands out the header, then each Gaussian.
    fn ply_pieces<E>(&self, mut put_piece: impl FnMut(&[u8]) -> Result<(), E>) -> Result<(), E> {
        let coefficients = self.rest_coefficients();
        let mut header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
            self.len()
        );
        let mut property = |name: &str| {
            header += "property float ";
            header += name;
            header += "\n";
        };
        for name in [
            "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2",
        ] {
            property(name);
        }
        for index in 0..3 * coefficients {
            property(&format!("f_rest_{index}"));
        }
        property("opacity");
        for index in 0..3 {
            property(&format!("scale_{index}"));
        }
        for index in 0..4 {
            property(&format!("rot_{index}"));
        }
        header += "end_header\n";
        put_piece(header.as_bytes())?;

        let arrays = &self.arrays;
        let mut row: Vec<u8> = Vec::new();
        let mut sh_rest = vec![0.0_f32; 3 * coefficients];
        let places = arrays.positions.iter().zip(&arrays.rotations);
        let looks = arrays.opacities.iter().zip(&arrays.colours);
        let all = places.zip(&arrays.log_scales).zip(looks).enumerate();
        for (index, (((position, rotation), log_scale), (opacity, colour))) in all {
            let start = index * sh_rest.len();
            if let Some(rest) = arrays.sh_rest.get(start..start + sh_rest.len()) {
                sh_rest.copy_from_slice(rest);
            }
            let mut splat = Splat {
                position: *position,
                rotation: *rotation,
                log_scale: *log_scale,
                opacity: *opacity,
                colour: *colour,
            };
            frame::turn(&mut splat, &mut sh_rest);
            let mut put = |value: f32| row.extend(value.to_le_bytes());
            splat.position.into_iter().for_each(&mut put);
            [0.0; 3].into_iter().for_each(&mut put);
            splat.colour.into_iter().for_each(&mut put);
            for channel in 0..3 {
                for coefficient in sh_rest.chunks_exact(3) {
                    put(coefficient[channel]);
                }
            }
            put(logit(splat.opacity));
            splat.log_scale.into_iter().for_each(&mut put);
            let [x, y, z, w] = splat.rotation;
            [w, x, y, z].into_iter().for_each(&mut put);
            put_piece(&row)?;
            row.clear();
        }
        Ok(())
    }
}

fn logit(opacity: f32) -> f32 {
    // In f64: near 1 the difference from 1 is what counts.
    let opacity = f64::from(opacity).clamp(1e-8, 1.0 - 1e-8);
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a value between -19 and 19 rounded to f32"
    )]
    let logit = (opacity / (1.0 - opacity)).ln() as f32;
    logit
}
