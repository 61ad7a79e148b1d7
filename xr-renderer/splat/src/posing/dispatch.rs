//! What dispatches of the posing passes have in common.

/// Invocations per workgroup.
pub(super) const GROUP: u32 = 64;

/// A place in a buffer of less than 4 GiB.
pub(super) fn word(at: usize) -> u32 {
    u32::try_from(at).unwrap_or_else(|_| unreachable!("the buffer was made"))
}
