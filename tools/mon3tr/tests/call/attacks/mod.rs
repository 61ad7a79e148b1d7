//! Attacks on the running programs, by clients without a link, by holders of a link, by members, owners and servers.
//!
//! Each attack runs in a bounded form with the other tests, and in its whole length by `./run attacks`.

mod authentication;
mod bounds;
mod hang_up;
mod membership;
mod packets;
mod relay;
mod secrets;
mod soak;

/// How often an attack is repeated, or how many seconds it lasts: `bounded` among the other tests, `whole` by `./run attacks`.
pub(crate) fn extent(bounded: u32, whole: u32) -> u32 {
    match std::env::var_os("MON3TR_ATTACKS") {
        Some(extent) if extent == "whole" => whole,
        _ => bounded,
    }
}
