//! The errors of the lab.

use std::net::{IpAddr, SocketAddr};

/// Why the lab could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum NetlabError {
    /// A bandwidth trace is not one.
    #[error(
        "{trace}, line {line}: {why}; a trace has lines of `ms,kbit/s` with growing times that begin at 0"
    )]
    Trace {
        /// The file's name or what the caller called it.
        trace: String,
        /// Counted from 1; the last one where the trace as a whole is wrong.
        line: usize,
        /// What is wrong there.
        why: String,
    },
    /// A trace could not be read at all.
    #[error("cannot read the trace {trace}")]
    ReadTrace {
        /// The file's name.
        trace: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// A value that no network can have.
    #[error("{what} is {value}, but must be {expected}")]
    OutOfRange {
        /// The value's name.
        what: &'static str,
        /// What was given.
        value: f64,
        /// The allowed values.
        expected: &'static str,
    },
    /// A socket cannot be opened.
    #[error("cannot open a socket on {address}")]
    Bind {
        /// Where.
        address: IpAddr,
        /// What the system said.
        source: std::io::Error,
    },
    /// A session description that cannot be led through the lab.
    #[error("cannot lead this session description through the lab: {0}")]
    Sdp(&'static str),
    /// The server behind the lab does not answer.
    #[error("the server at {server} does not answer: {why}")]
    Upstream {
        /// Its address.
        server: SocketAddr,
        /// What was tried, and the result.
        why: String,
    },
    /// A chart could not be drawn.
    #[error("cannot draw the chart: {0}")]
    Chart(String),
}
