//! A bucket of an S3-compatible store, for any number of servers.

use super::super::ByteRange;
use super::{Content, StoreError};
use crate::ServerError;
use futures_util::{StreamExt, TryStreamExt};
use object_store::aws::{AmazonS3, AmazonS3Builder};
use object_store::path::Path;
use object_store::{
    ClientOptions, GetOptions, MultipartUpload, ObjectStore, ObjectStoreExt, PutPayload,
    RetryConfig,
};
use std::fs::File;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncSeekExt};

/// Bytes held of an upload on its way to the bucket: a part's size, which has to be 5 MiB at least.
const PART: usize = 5 << 20;

#[derive(Debug)]
pub(in crate::packages) struct Bucket(AmazonS3);

impl Bucket {
    pub(super) fn open(
        bucket: &str,
        endpoint: Option<&str>,
        region: Option<&str>,
    ) -> Result<Self, ServerError> {
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
        Ok(Self(store))
    }

    pub(super) async fn size(&self, name: &str) -> Result<Option<u64>, StoreError> {
        let found = absent(self.0.head(&Path::from(name)).await)?;
        Ok(found.map(|found| found.size))
    }

    pub(super) async fn read(&self, name: &str, part: ByteRange) -> Result<Content, StoreError> {
        let options = GetOptions {
            range: Some((part.first..part.first + part.count).into()),
            ..GetOptions::default()
        };
        let found = self.0.get_opts(&Path::from(name), options).await;
        let chunks = found.map_err(StoreError::Bucket)?.into_stream();
        Ok(chunks.map_err(StoreError::Bucket).boxed())
    }

    pub(super) async fn put_name(&self, name: &str) -> Result<(), StoreError> {
        let put = self.0.put(&Path::from(name), PutPayload::default()).await;
        put.map(drop).map_err(StoreError::Bucket)
    }

    pub(super) async fn put(&self, name: &str, from: File) -> Result<(), StoreError> {
        let mut from = tokio::fs::File::from_std(from);
        from.rewind().await.map_err(StoreError::File)?;
        let put = self.0.put_multipart(&Path::from(name)).await;
        let mut put = put.map_err(StoreError::Bucket)?;
        let copied = copy(&mut from, put.as_mut()).await;
        if copied.is_err()
            && let Err(left) = put.abort().await
        {
            log::warn!("an upload that could not be stored is not undone: {left}");
        }
        copied
    }

    pub(super) async fn delete(&self, name: &str) -> Result<(), StoreError> {
        absent(self.0.delete(&Path::from(name)).await).map(drop)
    }

    pub(super) async fn names(&self, below: &str) -> Result<Vec<String>, StoreError> {
        let found = self.0.list(Some(&Path::from(below)));
        let names = found.map_ok(|found| found.location.to_string());
        names.try_collect().await.map_err(StoreError::Bucket)
    }
}

/// Copies a file part by part, and completes it.
async fn copy(from: &mut tokio::fs::File, to: &mut dyn MultipartUpload) -> Result<(), StoreError> {
    loop {
        let mut part = Vec::with_capacity(PART);
        let mut rest = (&mut *from).take(PART as u64);
        let read = rest.read_to_end(&mut part).await;
        if read.map_err(StoreError::File)? == 0 {
            break;
        }
        let part = PutPayload::from(part);
        to.put_part(part).await.map_err(StoreError::Bucket)?;
    }
    to.complete().await.map_err(StoreError::Bucket)?;
    Ok(())
}

/// What is not there is no error.
fn absent<T>(result: object_store::Result<T>) -> Result<Option<T>, StoreError> {
    match result {
        Ok(found) => Ok(Some(found)),
        Err(object_store::Error::NotFound { .. }) => Ok(None),
        Err(e) => Err(StoreError::Bucket(e)),
    }
}
