//! The forwarder as a process of its own, on the server's machine: it is what strangers send packets to, and its end,
//! by a fault or for want of memory, leaves signaling, store and relay as they are. Server and forwarder talk over a
//! Unix socket, in messages of `wire`.

mod apart;
mod process;
mod wire;

pub(super) use apart::Apart;
pub use process::{Options, run};
