//! A network of any quality on one machine, without root: a front for the real server that routes every call's packets through relays that
//! delay, lose, reorder, double and slow them, decided by a seed; statistics of the packets; and reports of calls.
//!
//! [`Lab`] is the whole; [`Link`] decides about each packet, without sockets or a clock. Starts no programs and measures no calls: its users do.

#![forbid(unsafe_code)]

mod calls;
mod error;
mod impairment;
mod lab;
mod link;
mod pacer;
mod proxy;
mod rate;
mod relay;
pub mod report;
pub mod sdp;
mod statistics;
mod tcp;
mod trace;
mod units;

pub use error::NetlabError;
pub use impairment::{Impairment, Jitter, Loss, Outage, Probability, Queue, Reordering};
pub use lab::{Lab, LabConfig};
pub use link::{Backlog, Cause, Fate, Link};
pub use rate::{BitRate, Rate};
pub use relay::Direction;
pub use statistics::{
    Count, DirectionStatistics, IP_UDP_HEADERS, Lost, Punctuality, Second, Statistics,
};
pub use tcp::{TcpImpairment, TcpPath, TcpRelay};
pub use trace::Trace;
