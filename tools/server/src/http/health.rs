//! Whether the server lives, whether it can serve, and the counters.

use super::{App, HttpError};
use axum::extract::State;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Mutex;

/// The least time between two checks of the store: any client may ask, and an S3 store charges for each.
const FRESH: Duration = Duration::from_secs(2);
const PROBE_WITHIN: Duration = Duration::from_secs(3);

/// The last check of the store.
#[derive(Debug, Default)]
pub(crate) struct Cached(Mutex<Option<(Instant, bool)>>);

/// It answers: whoever watches over the process has nothing to do, whatever the store and the other instances are like.
pub(super) async fn lives() -> &'static str {
    "ok"
}

/// Whether requests should come here.
pub(super) async fn is_ready(State(app): State<Arc<App>>) -> Result<&'static str, HttpError> {
    if app.stopping.is_cancelled() {
        return Err(HttpError::Stopping);
    }
    if app
        .relay
        .as_ref()
        .is_some_and(|relay| !relay.is_connected())
    {
        return Err(HttpError::NoNats);
    }
    if !store_answers(&app).await {
        return Err(HttpError::UnhealthyStore);
    }
    Ok("ok")
}

async fn store_answers(app: &App) -> bool {
    let mut last = app.health.0.lock().await;
    if let Some((when, well)) = *last
        && when.elapsed() < FRESH
    {
        return well;
    }
    let well = match tokio::time::timeout(PROBE_WITHIN, app.packages.probe()).await {
        Ok(Ok(())) => true,
        Ok(Err(e)) => {
            log::error!("the package store fails: {e}");
            false
        }
        Err(_) => false,
    };
    *last = Some((Instant::now(), well));
    well
}

#[cfg(feature = "metrics")]
pub(super) async fn metrics(State(app): State<Arc<App>>) -> impl axum::response::IntoResponse {
    if let Some(forwarding) = &app.forwarding {
        let viewers = i64::try_from(forwarding.viewers()).unwrap_or(i64::MAX);
        app.metrics.forwarded_to.set(viewers);
    }
    if let Some(relay) = app.ice.relay() {
        app.metrics.relay(relay.counts());
    }
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    (
        [(axum::http::header::CONTENT_TYPE, kind)],
        app.metrics.text(),
    )
}
