//! One file per sub-command.

pub(crate) mod apk;
pub(crate) mod bake;
pub(crate) mod bench;
pub(crate) mod demo;
pub(crate) mod inspect;
pub(crate) mod netlab;
pub(crate) mod profile;
pub(crate) mod receive;
pub(crate) mod render;
pub(crate) mod send;
pub(crate) mod serve;
