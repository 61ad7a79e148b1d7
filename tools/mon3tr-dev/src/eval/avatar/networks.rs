//! Distances that networks judge: LPIPS of two pictures, and features for the Frechet distance. Both networks are the user's own ONNX files.

use super::canvas::Canvas;
use anyhow::{Context, bail, ensure};
use npu_runtime::{Outputs, ProviderKind, Runtime, Session};
use perceptual_loss::NetworkFile;
use std::path::{Path, PathBuf};

/// A network that takes pictures `[1, 3, height, width]`.
#[derive(Debug)]
struct Network {
    path: PathBuf,
    session: Session,
    outputs: Outputs,
    /// Width and height.
    size: [usize; 2],
}

impl Network {
    /// Opens a network of so many inputs `[1, 3, height, width]` of one size, and one output.
    fn open(path: &Path, runtime: &Runtime, pictures: usize) -> anyhow::Result<Self> {
        let file = NetworkFile::read(path, pictures)?;
        let cannot = || format!("cannot use the network {}", path.display());
        let provider =
            ProviderKind::Cpu.with_threads(mon3tr::device_options::DeviceOptions::threads());
        let session = Session::new(runtime, &file.onnx, provider, &file.inputs, &[file.output])
            .with_context(cannot)?;
        Ok(Self {
            outputs: session.outputs().with_context(cannot)?,
            path: file.path,
            session,
            size: file.size,
        })
    }

    /// The output for pictures resampled from their `part`, each value by `scaled`.
    fn run(
        &mut self,
        pictures: &[&Canvas],
        part: [usize; 4],
        scaled: impl Fn(f32) -> f32,
    ) -> anyhow::Result<&[f32]> {
        for (index, picture) in pictures.iter().enumerate() {
            let resampled = picture.resampled(part, self.size);
            let planes = self.session.input_mut(index);
            let area = self.size[0] * self.size[1];
            for (channel, plane) in planes.chunks_exact_mut(area).enumerate() {
                for (to, pixel) in plane.iter_mut().zip(&resampled.pixels) {
                    *to = scaled(pixel[channel]);
                }
            }
        }
        let failed = || format!("the network {} failed", self.path.display());
        self.session.run(&mut self.outputs).with_context(failed)?;
        let values = self.outputs.get(0);
        ensure!(
            !values.is_empty() && values.iter().all(|value| value.is_finite()),
            "the network {} gave a number that is not finite",
            self.path.display()
        );
        Ok(values)
    }
}

/// LPIPS (Zhang et al., "The Unreasonable Effectiveness of Deep Features as a Perceptual Metric", 2018): a network of two pictures
/// `[1, 3, height, width]` with values -1..=1, whose one output is their distance.
#[derive(Debug)]
pub(super) struct Lpips(Network);

impl Lpips {
    pub(super) fn open(path: &Path, runtime: &Runtime) -> anyhow::Result<Self> {
        Ok(Self(Network::open(path, runtime, 2)?))
    }

    /// The distance of two pictures' `part`.
    pub(super) fn distance(
        &mut self,
        a: &Canvas,
        b: &Canvas,
        part: [usize; 4],
    ) -> anyhow::Result<f64> {
        let values = self.0.run(&[a, b], part, |value| 2.0 * value - 1.0)?;
        let &[distance] = values else {
            let count = values.len();
            bail!(
                "LPIPS is one number, but the network {} gives {count}",
                self.0.path.display()
            );
        };
        Ok(f64::from(distance))
    }
}

/// The features of the Frechet inception distance: a network of one picture `[1, 3, height, width]` with values 0..=1, whose one output is its
/// features (Inception's last pooling: 2048).
#[derive(Debug)]
pub(super) struct Features(Network);

impl Features {
    pub(super) fn open(path: &Path, runtime: &Runtime) -> anyhow::Result<Self> {
        Ok(Self(Network::open(path, runtime, 1)?))
    }

    /// The features of a picture's `part`.
    pub(super) fn of(&mut self, picture: &Canvas, part: [usize; 4]) -> anyhow::Result<Vec<f32>> {
        Ok(self.0.run(&[picture], part, |value| value)?.to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use perceptual_loss::Lpips as Loss;
    use splat_gradient::loss::PerceptualLoss;
    use test_support::{lpips, onnx};

    #[test]
    fn the_file_that_a_training_takes_gives_the_same_distance_here() {
        let Some(runtime) = onnx::runtime() else {
            return;
        };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("lpips.onnx");
        let net = lpips::alexnet(17, 64, [6, 8, 8, 6, 6]);
        std::fs::write(&path, net.file()).expect("written");
        let mut rng = fastrand::Rng::with_seed(3);
        let canvases = [(); 2].map(|()| {
            let pixels = (0..64 * 64).map(|_| [(); 3].map(|()| rng.f32())).collect();
            Canvas::new(64, pixels)
        });
        let planes = canvases.each_ref().map(|canvas| -> Vec<f32> {
            let planes = [0, 1, 2].map(|channel| canvas.pixels.iter().map(move |p| p[channel]));
            planes.into_iter().flatten().collect()
        });
        let mut loss = Loss::open(&path, &runtime, 1).expect("a network");
        let mut unused = vec![0.0; planes[0].len()];
        let expected = (loss.compare(&planes[0], &planes[1], &mut unused)).expect("compared");
        let mut judge = Lpips::open(&path, &runtime).expect("the same");
        let [a, b] = &canvases;
        let found = judge.distance(a, b, [0, 0, 64, 64]).expect("compared");
        assert!(found > 0.0, "they differ");
        assert!((found / expected - 1.0).abs() < 1e-6, "{found}, {expected}");
        let features = Features::open(&path, &runtime).expect_err("it takes two pictures");
        assert!(format!("{features:#}").contains("1 inputs"), "{features:#}");
    }
}
