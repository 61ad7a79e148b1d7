//! Writes a package's part file and hashes it, on a thread of its own, so that the disk does not delay the network.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom, Write},
    path::Path,
};

use bytes::Bytes;
use tokio::{sync::mpsc, task::JoinHandle};

use crate::cache::Lock;
use link_protocol::{PackageId, package_id::PackageHasher};

/// Pieces that may wait for the disk; a piece is one read of the socket, at most some 400 KB.
const QUEUE: usize = 32;

/// A part file that is being written.
#[derive(Debug)]
pub(crate) struct PartWriter {
    pieces: mpsc::Sender<Bytes>,
    thread: JoinHandle<io::Result<PackageId>>,
}

impl PartWriter {
    /// Writes after the first `kept` bytes of `path`. The thread holds the lock until its last byte is written, even after the download
    /// was cancelled.
    pub(crate) fn begin(path: &Path, kept: u64, lock: Lock) -> Self {
        let (pieces, queue) = mpsc::channel(QUEUE);
        let path = path.to_owned();
        let thread = tokio::task::spawn_blocking(move || {
            let result = write(&path, kept, queue);
            drop(lock);
            result
        });
        Self { pieces, thread }
    }

    /// Adds a piece; false if the writer has failed, with the error that [`PartWriter::finish`] returns.
    pub(crate) async fn push(&self, piece: Bytes) -> bool {
        self.pieces.send(piece).await.is_ok()
    }

    /// Waits until all is written, and returns the hash of the whole file.
    pub(crate) async fn finish(self) -> io::Result<PackageId> {
        drop(self.pieces);
        self.thread.await.map_err(io::Error::other)?
    }
}

fn write(path: &Path, kept: u64, mut queue: mpsc::Receiver<Bytes>) -> io::Result<PackageId> {
    let mut file = File::options()
        .create(true)
        .truncate(false)
        .read(true)
        .write(true)
        .open(path)?;
    if file.metadata()?.len() != kept {
        file.set_len(kept)?;
    }
    let mut hasher = PackageHasher::default();
    if hasher.read_from(&mut (&mut file).take(kept))? != kept {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    // The hasher's reads may have stopped anywhere.
    if kept > 0 {
        file.seek(SeekFrom::Start(kept))?;
    }
    while let Some(piece) = queue.blocking_recv() {
        file.write_all(&piece)?;
        hasher.update(&piece);
    }
    Ok(hasher.finish())
}
