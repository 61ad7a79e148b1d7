//! What a rehearsal needs built: the app's library for this machine's processor, and the shims it is loaded with.

mod app;
mod forward;
mod shims;

pub(crate) use app::build_app;
pub(crate) use shims::build_shims;
