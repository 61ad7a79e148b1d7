//! The network's threads.

use anyhow::Context;
use std::time::Duration;
use tokio::runtime::{Builder, Handle, Runtime};

/// How long to wait for their end. The system's look-up of a server's name cannot be cancelled and may take many seconds; its thread
/// ends by itself.
const FAREWELL: Duration = Duration::from_millis(200);

/// Threads that end when it is dropped.
#[derive(Debug)]
pub(super) struct Network(Option<Runtime>, Handle);

impl Network {
    /// Starts them.
    pub(super) fn start() -> anyhow::Result<Self> {
        let runtime = Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("network")
            .enable_all()
            .build()
            .context("cannot start the network's threads")?;
        let handle = runtime.handle().clone();
        Ok(Self(Some(runtime), handle))
    }

    /// The handle to spawn tasks on them.
    pub(super) fn handle(&self) -> &Handle {
        &self.1
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        if let Some(runtime) = self.0.take() {
            runtime.shutdown_timeout(FAREWELL);
        }
    }
}
