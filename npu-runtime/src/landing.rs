//! Where ONNX Runtime put a graph's nodes. It says so only in its log while a session is made, so each session
//! listens to its own.

use log::Level;
use ort::logging::{LogLevel, LoggerFunction};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// How many of a session's nodes run on which execution provider, by ONNX Runtime's names. Providers that compile
/// (QNN, NNAPI) fuse everything they take into one node.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Landing {
    /// Execution provider -> number of nodes after ONNX Runtime's optimisations.
    pub nodes: BTreeMap<String, usize>,
}

impl Landing {
    /// Whether every node runs on `provider`.
    #[must_use]
    pub fn is_wholly_on(&self, provider: crate::ProviderKind) -> bool {
        self.nodes.len() == 1 && self.nodes.contains_key(provider.ort_name())
    }
}

impl std::fmt::Display for Landing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parts = self.nodes.iter().map(|(name, n)| format!("{name} {n}"));
        f.write_str(&parts.collect::<Vec<_>>().join(", "))
    }
}

/// What a session's log said of its nodes.
#[derive(Debug, Default)]
pub(crate) struct Ear {
    heard: Mutex<Option<Heard>>,
}

#[derive(Debug, Default)]
struct Heard {
    landing: Landing,
    refused: Vec<String>,
}

impl Ear {
    /// A listener, and the logger to give to the session.
    pub(crate) fn new() -> (Arc<Self>, LoggerFunction) {
        let ear = Arc::new(Self {
            heard: Mutex::new(Some(Heard::default())),
        });
        let logger = {
            let ear = Arc::clone(&ear);
            Arc::new(
                move |level: LogLevel, _: &str, _: &str, location: &str, message: &str| {
                    ear.listen(message);
                    forward_to_log(level, location, message);
                },
            )
        };
        (ear, logger)
    }

    fn listen(&self, message: &str) {
        // Nearly all lines are others; they must not cost a lock in every run.
        let placed = message.contains("placed on [");
        if !placed && !message.contains(UNSUPPORTED) && !message.contains(NOT_SUPPORTED) {
            return;
        }
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(heard) = heard.as_mut() else { return };
        if let Some((provider, nodes)) = placed.then(|| parse_placed(message)).flatten() {
            *heard.landing.nodes.entry(provider).or_default() += nodes;
        }
        for node in parse_unsupported(message)
            .into_iter()
            .chain(parse_not_supported(message))
        {
            if !heard.refused.contains(&node) {
                heard.refused.push(node);
            }
        }
    }

    /// Where the nodes landed; nothing is listened to from here on.
    pub(crate) fn landing(&self) -> Landing {
        self.heard
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
            .map(|heard| heard.landing)
            .unwrap_or_default()
    }

    /// The nodes that a provider said it does not take, as `Operator NAME`.
    pub(crate) fn refused(&self) -> Vec<String> {
        self.heard
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
            .map(|heard| heard.refused)
            .unwrap_or_default()
    }
}

/// The line in which QNN lists what it does not take.
const UNSUPPORTED: &str = "Unsupported nodes in QNN EP:";

/// How the line begins in which NNAPI says of one node that it does not take it.
const NOT_SUPPORTED: &str = "Node supported: [0] Operator type: [";

/// ` All nodes placed on [X]. Number of nodes: N` or ` Node(s) placed on [X]. Number of nodes: N`.
fn parse_placed(message: &str) -> Option<(String, usize)> {
    let (_, rest) = message.split_once("placed on [")?;
    let (provider, rest) = rest.split_once(']')?;
    let (_, number) = rest.split_once("Number of nodes: ")?;
    Some((provider.to_owned(), number.trim().parse().ok()?))
}

/// `Unsupported nodes in QNN EP: { name: lone, type: Erf }, ...`
fn parse_unsupported(message: &str) -> Vec<String> {
    let Some((_, list)) = message.split_once(UNSUPPORTED) else {
        return Vec::new();
    };
    list.split('{')
        .filter_map(|item| {
            let (item, _) = item.split_once('}')?;
            let (name, operator) = item.split_once(", type:")?;
            let name = name.trim().strip_prefix("name:")?.trim();
            Some(format!("{} {name:?}", operator.trim()))
        })
        .collect()
}

/// `Node supported: [0] Operator type: [ReduceSum] index: [40] name: [residuals.ReduceSum] ...`; 1 where it takes it.
fn parse_not_supported(message: &str) -> Option<String> {
    let (_, rest) = message.split_once(NOT_SUPPORTED)?;
    let (operator, rest) = rest.split_once(']')?;
    let (_, rest) = rest.split_once("name: [")?;
    let (name, _) = rest.split_once(']')?;
    Some(format!("{operator} {name:?}"))
}

/// ONNX Runtime's levels as the `log` facade's.
pub(crate) fn forward_to_log(level: LogLevel, location: &str, message: &str) {
    let level = match level {
        LogLevel::Verbose => Level::Trace,
        LogLevel::Info => Level::Debug,
        LogLevel::Warning => Level::Warn,
        // Errors come back from the call that failed; here they would be logged twice.
        LogLevel::Error | LogLevel::Fatal => Level::Debug,
    };
    log::log!(level, "ONNX Runtime: {message} ({location})");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placements_and_refusals_are_read_from_the_log() {
        let (ear, _) = Ear::new();
        for line in [
            "Node placements",
            " Node(s) placed on [QNNExecutionProvider]. Number of nodes: 3",
            " Node(s) placed on [CPUExecutionProvider]. Number of nodes: 12",
            "Unsupported nodes in QNN EP: { name: lone, type: Erf }, { name: b, type: Einsum }, ",
            "Unsupported nodes in QNN EP: { name: lone, type: Erf }, ",
            "Node supported: [1] Operator type: [Gemm] index: [3] name: [mesh.first.out.Gemm] as part of the NodeUnit type: [Gemm]",
            "Node supported: [0] Operator type: [ReduceSum] index: [40] name: [residuals.ReduceSum] as part of the NodeUnit type: [ReduceSum]",
        ] {
            ear.listen(line);
        }
        let heard = ear.heard.lock().expect("no panic").take().expect("heard");
        assert_eq!(
            heard.refused,
            [
                r#"Erf "lone""#,
                r#"Einsum "b""#,
                r#"ReduceSum "residuals.ReduceSum""#
            ],
            "once"
        );
        assert_eq!(
            heard.landing.to_string(),
            "CPUExecutionProvider 12, QNNExecutionProvider 3",
            "both providers"
        );
        assert!(
            !heard.landing.is_wholly_on(crate::ProviderKind::Qnn),
            "some are on the CPU"
        );
    }
}
