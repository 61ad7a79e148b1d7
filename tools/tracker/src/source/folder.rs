//! A folder of PNG and JPEG pictures, in the order in which a person would count them.

use std::cmp::Ordering;
use std::fs::{File, read_dir};
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use std::time::Instant;

use image::{ImageFormat, ImageReader, Limits};

use super::error::SourceError;
use super::jpeg::JpegPictures;
use super::picture::{LARGEST_SIDE, Picture, RATE_HZ, Source, SourceInfo, within_limits};

/// Ten hours at 30 Hz.
const MOST_PICTURES: usize = 1_080_000;
/// Of one file: an uncompressed picture of the largest size has fewer.
const MOST_BYTES: u64 = 256 << 20;

/// The pictures of a folder, one after another.
#[derive(Debug)]
pub(super) struct Folder {
    info: SourceInfo,
    files: std::vec::IntoIter<PathBuf>,
    /// Of the file being read.
    bytes: Vec<u8>,
    jpeg: JpegPictures,
    first: Option<Picture>,
    number: u64,
}

impl Folder {
    /// Lists the folder and reads its first picture.
    pub(super) fn open(folder: &Path) -> Result<Self, SourceError> {
        let name = folder.display().to_string();
        let failed = |source| SourceError::Read {
            name: name.clone(),
            source,
        };
        let mut files = Vec::new();
        for entry in read_dir(folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if is_picture(&path) {
                files.push(path);
            }
            if files.len() > MOST_PICTURES {
                return Err(SourceError::Malformed {
                    name,
                    why: format!("it has more than {MOST_PICTURES} pictures: make a video of them"),
                });
            }
        }
        if files.is_empty() {
            return Err(SourceError::NoPicture {
                name,
                why: "it has no .png, .jpg or .jpeg file".to_owned(),
            });
        }
        files.sort_by(|a, b| natural(&file_name(a), &file_name(b)));
        let mut folder = Self {
            info: SourceInfo {
                name,
                width: 0,
                height: 0,
                rate_hz: Some(RATE_HZ),
                frames: Some(files.len() as u64),
            },
            files: files.into_iter(),
            bytes: Vec::new(),
            jpeg: JpegPictures::default(),
            first: None,
            number: 0,
        };
        let mut first = Picture::empty();
        folder.read(&mut first)?;
        (folder.info.width, folder.info.height) = (first.width, first.height);
        folder.first = Some(first);
        Ok(folder)
    }

    fn read(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        let Some(path) = self.files.next() else {
            return Ok(false);
        };
        let name = path.display().to_string();
        self.bytes.clear();
        File::open(&path)
            .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut self.bytes))
            .map_err(|source| SourceError::Read {
                name: name.clone(),
                source,
            })?;
        if self.bytes.len() as u64 > MOST_BYTES {
            return Err(SourceError::Malformed {
                name,
                why: format!("it is larger than {} MiB", MOST_BYTES >> 20),
            });
        }
        // By its contents: a name may lie.
        if self.bytes.starts_with(b"\xff\xd8") {
            self.jpeg.decode(&name, &self.bytes, into)?;
        } else {
            decode_png(&name, &self.bytes, into)?;
        }
        Ok(true)
    }
}

fn decode_png(name: &str, bytes: &[u8], into: &mut Picture) -> Result<(), SourceError> {
    let refuse = |why: String| SourceError::Malformed {
        name: name.to_owned(),
        why,
    };
    // Its size first, so that a message can name it.
    let (width, height) = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png)
        .into_dimensions()
        .map_err(|why| refuse(format!("it is no PNG or JPEG picture: {why}")))?;
    within_limits(name, width, height)?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    reader.limits(limits);
    let decoded = reader
        .decode()
        .map_err(|why| refuse(why.to_string()))?
        .into_rgb8();
    into.resize(width, height);
    if decoded.as_raw().len() != into.rgb.len() {
        return Err(refuse("its size changes while it is read".to_owned()));
    }
    into.rgb.copy_from_slice(decoded.as_raw());
    Ok(())
}

impl Source for Folder {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next(&mut self, into: &mut Picture) -> Result<bool, SourceError> {
        into.at = Instant::now();
        if let Some(mut first) = self.first.take() {
            std::mem::swap(&mut into.rgb, &mut first.rgb);
            (into.width, into.height) = (first.width, first.height);
        } else {
            match self.read(into) {
                Ok(true) => {}
                Ok(false) => return Ok(false),
                Err(error) => {
                    self.files = Vec::new().into_iter();
                    log::warn!(
                        "{} breaks off after {} pictures: {error}",
                        self.info.name,
                        self.number
                    );
                    return Ok(false);
                }
            }
        }
        if (into.width, into.height) != (self.info.width, self.info.height) {
            self.files = Vec::new().into_iter();
            return Err(SourceError::SizeChanged {
                name: self.info.name.clone(),
                number: self.number,
                width: into.width,
                height: into.height,
                first_width: self.info.width,
                first_height: self.info.height,
            });
        }
        into.number = self.number;
        #[allow(clippy::cast_precision_loss, reason = "at most a million pictures")]
        {
            into.seconds = self.number as f64 / RATE_HZ;
        }
        self.number += 1;
        Ok(true)
    }
}

/// Hidden files are none: some systems leave such beside each picture.
fn is_picture(path: &Path) -> bool {
    let ending = path
        .extension()
        .map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    matches!(ending.as_deref(), Some("png" | "jpg" | "jpeg")) && !file_name(path).starts_with('.')
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// Digits that stand together compare as a number: `2.png` before `10.png`.
fn natural(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    while !left.is_empty() && !right.is_empty() {
        let (x, more_left) = part(left);
        let (y, more_right) = part(right);
        let order = if x.starts_with(|c: char| c.is_ascii_digit())
            && y.starts_with(|c: char| c.is_ascii_digit())
        {
            let (x, y) = (x.trim_start_matches('0'), y.trim_start_matches('0'));
            x.len().cmp(&y.len()).then_with(|| x.cmp(y))
        } else {
            x.cmp(y)
        };
        if order != Ordering::Equal {
            return order;
        }
        (left, right) = (more_left, more_right);
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

/// The digits, or what is none, at the start; and the rest.
fn part(text: &str) -> (&str, &str) {
    let digits = text.starts_with(|c: char| c.is_ascii_digit());
    let end = text
        .find(|c: char| c.is_ascii_digit() != digits)
        .unwrap_or(text.len());
    text.split_at(end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_are_ordered_as_a_person_counts() {
        let mut names = [
            "b10", "b9", "b09", "a", "b1x", "b1", "10", "9", "b9.2", "b9.10", "b",
        ];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            [
                "9", "10", "a", "b", "b1", "b1x", "b09", "b9", "b9.2", "b9.10", "b10"
            ],
            "order"
        );
    }

    proptest! {
        #[test]
        fn the_order_of_names_is_total(a in "[a-c0-2é.]{0,6}", b in "[a-c0-2é.]{0,6}", c in "[a-c0-2é.]{0,6}") {
            prop_assert_eq!(natural(&a, &b), natural(&b, &a).reverse(), "antisymmetric");
            prop_assert_eq!(natural(&a, &b) == Ordering::Equal, a == b, "distinct names differ");
            if natural(&a, &b).is_le() && natural(&b, &c).is_le() {
                prop_assert!(natural(&a, &c).is_le(), "transitive");
            }
        }
    }
}
