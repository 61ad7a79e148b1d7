//! Signaling and the avatar store.
