//! The app's library, by the route that the headset's own is built by.

use android_native::native::{Built, Order, Processor, Purpose, Route, build};
use anyhow::Context;
use std::path::Path;

/// The package of the workspace that is the app, and its library.
const PACKAGE: &str = "mon3tr-android";
const LIBRARY: &str = "main";

/// Builds it: for x86_64, and stripped as the package's is.
pub(crate) fn build_app(repo: &Path) -> anyhow::Result<Built> {
    let route = Route::find(Some(&repo.join(".cache/clang/run")))?;
    println!(
        "building the app for x86_64-linux-android, {}",
        route.describe()
    );
    let order = Order {
        repo,
        package: PACKAGE,
        library: LIBRARY,
        purpose: Purpose::Debug,
        processor: Processor::X86_64,
        target: &repo.join("target/android"),
    };
    build(&order, &route).context("the app cannot be built")
}
