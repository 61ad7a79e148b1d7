//! A picture of a person, and a tracker to look at it.

use npu_runtime::Runtime;
use std::sync::Arc;
use tracker::mediapipe::Options;
use tracker::networks::NetworkSet;
use tracker::source::Picture;
use tracker::{Tracker, TrackerError};

/// A picture, RGB.
#[derive(Clone)]
pub(super) struct Still {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) rgb: Vec<u8>,
}

impl Still {
    pub(super) fn black(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            rgb: vec![0; width * height * 3],
        }
    }

    pub(super) fn person() -> Self {
        let bytes: &[u8] = include_bytes!("../person/waist-up.webp");
        let mut decoder = image_webp::WebPDecoder::new(std::io::Cursor::new(bytes)).unwrap();
        let (width, height) = decoder.dimensions();
        let mut still = Self::black(width as usize, height as usize);
        decoder.read_image(&mut still.rgb).unwrap();
        still
    }

    /// As a source gives it.
    pub(super) fn at(&self, seconds: f64) -> Arc<Picture> {
        Arc::new(Picture {
            width: u32::try_from(self.width).unwrap(),
            height: u32::try_from(self.height).unwrap(),
            rgb: self.rgb.clone(),
            seconds,
            ..Picture::empty()
        })
    }

    /// Every pixel from where `from` says, black where that is nothing.
    pub(super) fn rearranged(
        &self,
        width: usize,
        height: usize,
        from: impl Fn(usize, usize) -> Option<(usize, usize)>,
    ) -> Self {
        let mut new = Self::black(width, height);
        for y in 0..height {
            for x in 0..width {
                if let Some((from_x, from_y)) =
                    from(x, y).filter(|(x, y)| *x < self.width && *y < self.height)
                {
                    let (to, from) = ((y * width + x) * 3, (from_y * self.width + from_x) * 3);
                    new.rgb[to..to + 3].copy_from_slice(&self.rgb[from..from + 3]);
                }
            }
        }
        new
    }

    pub(super) fn mirrored(&self) -> Self {
        self.rearranged(self.width, self.height, |x, y| {
            Some((self.width - 1 - x, y))
        })
    }
}

/// A tracker, if this machine has the networks and a runtime; in CI it must.
pub(super) fn tracker(options: Options) -> Option<Tracker> {
    let models = NetworkSet::folder_of_environment().and_then(|folder| {
        let runtime = Runtime::open(None).map_err(|source| TrackerError::Runtime {
            network: "of any name".into(),
            source,
        })?;
        options.load(&folder, &runtime)
    });
    match models {
        Ok(models) => Some(Tracker::new(models).unwrap()),
        Err(
            why @ (TrackerError::NoFolder
            | TrackerError::Missing { .. }
            | TrackerError::Runtime { .. }),
        ) => {
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{why}");
            println!("skipped: {why}");
            None
        }
        Err(fault) => panic!("{fault}"),
    }
}
