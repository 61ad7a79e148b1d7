//! The way into logcat.

use super::{TAG, log_panics};
use android_logger::{Config, FilterBuilder};
use log::LevelFilter;

/// Logs to logcat from now on, at most what [`log::set_max_level`] lets through.
pub fn start() {
    // What the WebRTC library warns of is the ordinary course of a connection being made.
    let filter = FilterBuilder::new()
        .filter_level(LevelFilter::Trace)
        .filter_module("rtc", LevelFilter::Error)
        .filter_module("webrtc", LevelFilter::Error)
        .build();
    android_logger::init_once(
        Config::default()
            .with_max_level(LevelFilter::Trace)
            .with_filter(filter)
            .with_tag(TAG),
    );
    log::set_max_level(LevelFilter::Info);
    log_panics();
}
