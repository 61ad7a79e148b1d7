//! Opening the two kinds of store.

use crate::{ServerError, StoreConfig};
use object_store::ObjectStore;
use object_store::local::LocalFileSystem;
#[cfg(feature = "s3")]
use object_store::{ClientOptions, RetryConfig, aws::AmazonS3Builder};
use std::fs::{File, TryLockError};
use std::path::Path;
use std::sync::Arc;
#[cfg(feature = "s3")]
use std::time::Duration;

type Opened = (Arc<dyn ObjectStore>, Option<File>);

pub(super) fn open(config: &StoreConfig) -> Result<Opened, ServerError> {
    match config {
        StoreConfig::Local(folder) => local(folder),
        #[cfg(feature = "s3")]
        StoreConfig::S3 {
            bucket,
            endpoint,
            region,
        } => s3(bucket, endpoint.as_deref(), region.as_deref()).map(|store| (store, None)),
    }
}

fn local(folder: &Path) -> Result<Opened, ServerError> {
    let unusable = |source| ServerError::Folder {
        path: folder.to_path_buf(),
        purpose: "the package store",
        source,
    };
    std::fs::create_dir_all(folder.join(super::PACKAGES)).map_err(unusable)?;
    let lock = File::create(folder.join("lock")).map_err(unusable)?;
    #[expect(
        clippy::disallowed_methods,
        reason = "what it does nothing on is Android, where no server runs"
    )]
    let locked = lock.try_lock();
    locked.map_err(|e| match e {
        TryLockError::WouldBlock => ServerError::FolderTaken {
            path: folder.to_path_buf(),
        },
        TryLockError::Error(source) => unusable(source),
    })?;
    sweep_staged(&folder.join(super::PACKAGES)).map_err(unusable)?;
    let store = LocalFileSystem::new_with_prefix(folder).map_err(|source| ServerError::Store {
        store: format!("in {}", folder.display()),
        source,
    })?;
    Ok((Arc::new(store.with_fsync(true)), Some(lock)))
}

/// Removes what object_store was writing when an earlier process died: it writes to `NAME#NUMBER` and renames.
fn sweep_staged(packages: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(packages)? {
        let entry = entry?;
        if entry.file_name().to_string_lossy().contains('#') {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

#[cfg(feature = "s3")]
fn s3(
    bucket: &str,
    endpoint: Option<&str>,
    region: Option<&str>,
) -> Result<Arc<dyn ObjectStore>, ServerError> {
    // No limit on a whole request, because a download goes at its client's pace; none of its parts may stall.
    let client = ClientOptions::new()
        .with_timeout_disabled()
        .with_connect_timeout(Duration::from_secs(5))
        .with_read_timeout(Duration::from_secs(30));
    let retry = RetryConfig {
        max_retries: 3,
        retry_timeout: Duration::from_secs(20),
        ..RetryConfig::default()
    };
    let mut builder = AmazonS3Builder::from_env()
        .with_bucket_name(bucket)
        .with_client_options(client)
        .with_retry(retry);
    if let Some(region) = region {
        builder = builder.with_region(region);
    }
    if let Some(endpoint) = endpoint {
        builder = builder
            .with_endpoint(endpoint)
            .with_allow_http(endpoint.starts_with("http://"));
    }
    let store = builder.build().map_err(|source| ServerError::Store {
        store: format!("in the bucket {bucket}"),
        source,
    })?;
    Ok(Arc::new(store))
}
