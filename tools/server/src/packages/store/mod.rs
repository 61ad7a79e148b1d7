//! Where packages and records lie: a folder, or a bucket of an S3-compatible store. A name is a relative path with `/` between its parts.
//! What is stored appears under its name when it is complete, not before.

#[cfg(feature = "s3")]
mod bucket;
mod folder;

use super::ByteRange;
use crate::{ServerError, StoreConfig};
use bytes::Bytes;
use folder::Folder;
use futures_util::stream::BoxStream;
use std::fs::File;

/// Why the store fails.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StoreError {
    #[error("{0}")]
    File(#[source] std::io::Error),
    #[cfg(feature = "s3")]
    #[error("{0}")]
    Bucket(#[source] object_store::Error),
}

/// What comes of a package that is read.
pub(crate) type Content = BoxStream<'static, Result<Bytes, StoreError>>;

/// A folder or a bucket.
#[derive(Debug)]
pub(super) enum Store {
    Folder(Folder),
    #[cfg(feature = "s3")]
    Bucket(bucket::Bucket),
}

impl Store {
    pub(super) fn open(config: &StoreConfig) -> Result<Self, ServerError> {
        match config {
            StoreConfig::Local(folder) => Folder::open(folder).map(Self::Folder),
            #[cfg(feature = "s3")]
            StoreConfig::S3 {
                bucket,
                endpoint,
                region,
            } => bucket::Bucket::open(bucket, endpoint.as_deref(), region.as_deref())
                .map(Self::Bucket),
        }
    }

    /// Bytes of all packages in a folder, of which a bucket tells nothing.
    pub(super) fn bytes(&self) -> Result<u64, ServerError> {
        match self {
            Self::Folder(folder) => folder.bytes(),
            #[cfg(feature = "s3")]
            Self::Bucket(_) => Ok(0),
        }
    }

    /// Bytes of what has this name, if there is anything.
    pub(super) async fn size(&self, name: &str) -> Result<Option<u64>, StoreError> {
        match self {
            Self::Folder(folder) => folder.size(name).await,
            #[cfg(feature = "s3")]
            Self::Bucket(bucket) => bucket.size(name).await,
        }
    }

    /// Some bytes of what has this name.
    pub(super) async fn read(&self, name: &str, part: ByteRange) -> Result<Content, StoreError> {
        match self {
            Self::Folder(folder) => folder.read(name, part).await,
            #[cfg(feature = "s3")]
            Self::Bucket(bucket) => bucket.read(name, part).await,
        }
    }

    /// Stores nothing but the name.
    pub(super) async fn put_name(&self, name: &str) -> Result<(), StoreError> {
        match self {
            Self::Folder(folder) => folder.put(name, None).await,
            #[cfg(feature = "s3")]
            Self::Bucket(bucket) => bucket.put_name(name).await,
        }
    }

    /// Stores all of a file.
    pub(super) async fn put(&self, name: &str, from: File) -> Result<(), StoreError> {
        match self {
            Self::Folder(folder) => folder.put(name, Some(from)).await,
            #[cfg(feature = "s3")]
            Self::Bucket(bucket) => bucket.put(name, from).await,
        }
    }

    /// Removes what has this name, if there is anything.
    pub(super) async fn delete(&self, name: &str) -> Result<(), StoreError> {
        match self {
            Self::Folder(folder) => folder.delete(name).await,
            #[cfg(feature = "s3")]
            Self::Bucket(bucket) => bucket.delete(name).await,
        }
    }

    /// All names that begin with `below` and a `/`.
    pub(super) async fn names(&self, below: &str) -> Result<Vec<String>, StoreError> {
        match self {
            Self::Folder(folder) => folder.names(below).await,
            #[cfg(feature = "s3")]
            Self::Bucket(bucket) => bucket.names(below).await,
        }
    }
}
