//! Small folders in each layout, and ways to break them.

#![allow(dead_code, reason = "each test file uses a part of it")]

pub(crate) mod published;

use capture::{Capture, CaptureError};
use std::fs;
use std::path::Path;

/// A PNG of one colour that depends on `seed`.
pub(crate) fn png(path: &Path, size: [u32; 2], seed: u8) {
    fs::create_dir_all(path.parent().expect("a folder")).expect("made");
    image::RgbImage::from_fn(size[0], size[1], |x, y| {
        let value = |k: u32| {
            u8::try_from((x * 7 + y * 13 + k * 50 + u32::from(seed)) % 256).expect("a byte")
        };
        image::Rgb([value(0), value(1), value(2)])
    })
    .save_with_format(path, image::ImageFormat::Png)
    .expect("written");
}

/// An archive of arrays in single precision.
pub(crate) fn npz(path: &Path, arrays: &[(&str, &[usize], Vec<f32>)]) {
    let mut archive = spmm3::NpzWriter::default();
    for (name, shape, values) in arrays {
        archive.numbers(name, shape, values).expect("an array");
    }
    fs::write(path, archive.finish().expect("an archive")).expect("written");
}

/// The whole message with its causes.
pub(crate) fn message(error: &CaptureError) -> String {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(error) = cause {
        text += &format!(": {error}");
        cause = error.source();
    }
    text
}

/// Opens the folder, or reads its first photographs: what is said when that fails.
pub(crate) fn said(folder: &Path) -> String {
    let opened = Capture::open(folder).and_then(|capture| {
        for camera in 0..capture.cameras().len() {
            for frame in 0..capture.frames() {
                capture.photograph(camera, frame)?;
            }
        }
        Ok(())
    });
    message(&opened.expect_err("a broken folder is refused"))
}

/// Replaces a text in a file; it must be there.
pub(crate) fn edit(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).expect("read");
    assert!(text.contains(from), "{from} is in {}", path.display());
    fs::write(path, text.replacen(from, to, 1)).expect("written");
}

/// Cuts a file to a share of its bytes.
pub(crate) fn cut(path: &Path, percent: usize) {
    let bytes = fs::read(path).expect("read");
    fs::write(path, &bytes[..bytes.len() * percent / 100]).expect("written");
}

/// A way to break a folder that was written, and words that the message has.
pub(crate) struct Break<'a> {
    pub(crate) what: &'a str,
    pub(crate) broken: Box<dyn Fn(&Path) + 'a>,
    pub(crate) words: Vec<String>,
}

/// A way to break.
pub(crate) fn way<'a>(what: &'a str, words: &[&str], broken: impl Fn(&Path) + 'a) -> Break<'a> {
    Break {
        what,
        broken: Box::new(broken),
        words: words.iter().map(|word| (*word).to_owned()).collect(),
    }
}

/// Breaks a folder that `write` makes in each way: every one is refused with its words.
pub(crate) fn refused(write: fn(&Path), ways: &[Break<'_>]) {
    for Break {
        what,
        broken,
        words,
    } in ways
    {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path());
        Capture::open(folder.path()).expect("good before it is broken");
        broken(folder.path());
        let said = said(folder.path());
        for word in words {
            assert!(said.contains(word), "{what}, {word}: {said}");
        }
    }
}
