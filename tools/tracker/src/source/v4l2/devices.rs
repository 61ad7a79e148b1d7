//! Which cameras there are, and why one cannot be opened.

use std::fs::{read_dir, read_to_string};
use std::io;
use std::path::Path;

use rustix::io::Errno;

use crate::source::error::SourceError;

/// Of the system, to open a camera.
pub(super) fn refusal(device: &str, source: io::Error) -> SourceError {
    match Errno::from_io_error(&source) {
        Some(Errno::NOENT | Errno::NODEV | Errno::NXIO | Errno::NOTDIR) => SourceError::NoDevice {
            device: device.to_owned(),
            present: present(),
        },
        _ => SourceError::of_camera(device, "to open", source),
    }
}

/// Which cameras there are, as a part of a message.
pub(super) fn present() -> String {
    list(Path::new("/dev"), Path::new("/sys/class/video4linux"))
}

pub(super) fn list(devices: &Path, names: &Path) -> String {
    let mut found: Vec<(u32, String)> = read_dir(devices)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| {
            let file = entry.file_name().to_str()?.to_owned();
            let number = file.strip_prefix("video")?.parse().ok()?;
            let card = read_to_string(names.join(&file).join("name")).unwrap_or_default();
            let shown = if card.trim().is_empty() {
                String::new()
            } else {
                format!(" ({})", card.trim())
            };
            Some((number, format!("{}{shown}", entry.path().display())))
        })
        .collect();
    found.sort();
    if found.is_empty() {
        return "this system has none (in a container or virtual machine, it has to be handed in); a video file will do too".to_owned();
    }
    let names: Vec<String> = found.into_iter().map(|(_, name)| name).collect();
    format!("there are {}", names.join(", "))
}
