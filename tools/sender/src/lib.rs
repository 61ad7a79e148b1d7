//! The sending side of a call.
