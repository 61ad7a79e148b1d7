//! LPIPS with its gradient.

use crate::error::{NetworkError, NetworkFault};
use crate::file::NetworkFile;
use npu_runtime::{Outputs, Provider, Runtime, RuntimeError, Session, TensorSpec};
use onnx_gradient::append_gradient;
use sha2::{Digest, Sha256};
use splat_gradient::error::{GradientError, check_count};
use splat_gradient::loss::PerceptualLoss;
use std::path::{Path, PathBuf};

/// A network of two pictures of values -1..=1, whose one output is their distance; the first is what was drawn.
#[derive(Debug)]
pub struct Lpips {
    path: PathBuf,
    identity: String,
    size: [usize; 2],
    session: Session,
    /// The distance, and its derivatives by the first picture.
    outputs: Outputs,
}

/// A run that gives nothing to go on with.
#[derive(Debug, thiserror::Error)]
#[error("the network {} {}", path.display(), what)]
struct Failed {
    path: PathBuf,
    what: &'static str,
    #[source]
    source: Option<RuntimeError>,
}

impl Lpips {
    /// Opens a network's file, to run on so many threads of the CPU. ONNX Runtime splits no sum among threads, so that their number does not change a bit.
    ///
    /// # Errors
    /// As [`NetworkFile::read`] has them, and a network that cannot be derived or run.
    pub fn open(path: &Path, runtime: &Runtime, threads: usize) -> Result<Self, NetworkError> {
        let file = NetworkFile::read(path, 2)?;
        let refused = |fault| NetworkError {
            path: path.to_path_buf(),
            fault,
        };
        Self::of_file(file, runtime, threads).map_err(refused)
    }

    fn of_file(file: NetworkFile, runtime: &Runtime, threads: usize) -> Result<Self, NetworkFault> {
        let digest = Sha256::digest(&file.onnx);
        let drawn = &file.inputs[0].name;
        let derived = append_gradient(&file.onnx, drawn).map_err(NetworkFault::Gradient)?;
        let gradient = TensorSpec::new(&derived.gradient, &derived.shape);
        let outputs = [file.output, gradient];
        let provider = Provider::Cpu { threads };
        let session = Session::new(runtime, &derived.onnx, provider, &file.inputs, &outputs)
            .map_err(NetworkFault::Session)?;
        Ok(Self {
            path: file.path,
            identity: digest.iter().map(|byte| format!("{byte:02x}")).collect(),
            size: file.size,
            outputs: session.outputs().map_err(NetworkFault::Session)?,
            session,
        })
    }

    fn failed(&self, what: &'static str, source: Option<RuntimeError>) -> GradientError {
        GradientError::Perceptual(Box::new(Failed {
            path: self.path.clone(),
            what,
            source,
        }))
    }
}

impl PerceptualLoss for Lpips {
    fn size(&self) -> [usize; 2] {
        self.size
    }

    fn identity(&self) -> &str {
        &self.identity
    }

    fn compare(
        &mut self,
        drawn: &[f32],
        wanted: &[f32],
        by_drawn: &mut [f32],
    ) -> Result<f64, GradientError> {
        let numbers = 3 * self.size[0] * self.size[1];
        for (what, got) in [
            ("the drawn picture", drawn.len()),
            ("the picture to be met", wanted.len()),
            ("derivatives by pixels", by_drawn.len()),
        ] {
            check_count(what, got, numbers)?;
        }
        for (index, picture) in [drawn, wanted].into_iter().enumerate() {
            for (to, value) in self.session.input_mut(index).iter_mut().zip(picture) {
                *to = 2.0 * value - 1.0;
            }
        }
        self.session
            .run(&mut self.outputs)
            .map_err(|why| self.failed("failed", Some(why)))?;
        let (distance, gradient) = (self.outputs.get(0), self.outputs.get(1));
        let finite = |numbers: &[f32]| numbers.iter().all(|number| number.is_finite());
        let &[distance] = distance else {
            return Err(self.failed("gave no number", None));
        };
        if !distance.is_finite() || !finite(gradient) {
            return Err(self.failed("gave a number that is not finite", None));
        }
        for (to, by) in by_drawn.iter_mut().zip(gradient) {
            *to = 2.0 * by;
        }
        Ok(f64::from(distance))
    }
}
