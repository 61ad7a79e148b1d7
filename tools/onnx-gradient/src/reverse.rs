//! The reverse pass: from the output to the input, each node's derivatives once.

use crate::emitter::Emitter;
use crate::error::DeriveError;
use crate::network::{Network, Step};
use crate::operator::{self, Operator};
use onnx_schema::Node;
use std::collections::{HashMap, HashSet};

/// The nodes that compute a gradient.
#[derive(Debug)]
pub(crate) struct Gradient {
    pub(crate) nodes: Vec<Node>,
    /// The value that is the gradient.
    pub(crate) output: String,
}

/// Derives the network's output by its `input`.
pub(crate) fn gradient(network: &Network<'_>, input: &str) -> Result<Gradient, DeriveError> {
    let independent = || DeriveError::Independent(input.to_owned());
    let between = Between::of(network, input);
    let shape = network
        .shape(input)
        .filter(|_| between.values.contains(network.output));
    let shape = shape.ok_or_else(independent)?;
    let mut emitter = Emitter::new(network.opset, network.names());
    // Of each value, its derivatives by each of the nodes that take it.
    let mut shares: HashMap<&str, Vec<String>> = HashMap::new();
    let one = emitter.scalar(1.0);
    let seed_shape = network.shape(network.output).unwrap_or_default();
    let seed = emitter.expand(&one, seed_shape);
    shares.insert(network.output, vec![seed]);
    for step in between.understood()?.into_iter().rev() {
        let node = step.node;
        let failed = |reason| refused(node, reason);
        let mut outputs = node.output.iter().map(String::as_str);
        let first = outputs.next().unwrap_or_default();
        if outputs.any(|other| shares.contains_key(other)) {
            return Err(failed("something depends on its second output".to_owned()));
        }
        let all = shares.remove(first).unwrap_or_default();
        let Some(by_output) = emitter.sum(&all) else {
            continue;
        };
        for (at, taken) in node.input.iter().enumerate() {
            if between.values.contains(taken.as_str()) {
                let shapes = operator::Shapes::of(node, at, |name| network.shape(name));
                let share = shapes
                    .and_then(|shapes| step.operator.pull_back(&mut emitter, &shapes, &by_output))
                    .map_err(failed)?;
                shares.entry(taken).or_default().push(share);
            }
        }
    }
    let all = shares.remove(input).unwrap_or_default();
    let sum = emitter.sum(&all).ok_or_else(independent)?;
    // Once more in the very shape of the input, under a name that is the output's alone.
    let output = emitter.reshape(&sum, shape);
    Ok(Gradient {
        nodes: emitter.finish(),
        output,
    })
}

/// A node on the way that cannot be derived.
fn refused(node: &Node, reason: String) -> DeriveError {
    DeriveError::Operator {
        operator: operator::name(node).to_owned(),
        node: operator::label(node).to_owned(),
        reason,
    }
}

/// A node with what it does.
struct Understood<'a> {
    node: &'a Node,
    operator: &'a Operator,
}

/// What lies between the input and the output.
struct Between<'a, 'm> {
    /// Values that depend on the input and that the output depends on.
    values: HashSet<&'a str>,
    /// Nodes that take such a value and give one, in the order of their execution.
    steps: Vec<&'a Step<'m>>,
}

impl<'a, 'm> Between<'a, 'm> {
    fn of(network: &'a Network<'m>, input: &'a str) -> Self {
        // An optional port that is left out has an empty name, and is no value.
        let named = |name: &&str| !name.is_empty();
        let mut dependent = HashSet::from([input]);
        for Step { node, .. } in &network.nodes {
            if node
                .input
                .iter()
                .any(|name| dependent.contains(name.as_str()))
            {
                dependent.extend(node.output.iter().map(String::as_str).filter(named));
            }
        }
        let mut needed = HashSet::from([network.output]);
        let mut steps = Vec::new();
        for step in network.nodes.iter().rev() {
            let gives = |name: &String| needed.contains(name.as_str());
            if step.node.output.iter().any(gives) {
                needed.extend(step.node.input.iter().map(String::as_str).filter(named));
                let takes = |name: &String| dependent.contains(name.as_str());
                if step.node.input.iter().any(takes) {
                    steps.push(step);
                }
            }
        }
        steps.reverse();
        let values = dependent.intersection(&needed).copied().collect();
        Self { values, steps }
    }

    /// The nodes with what they do; else the first of them whose operator is not known, since what follows it is not known only because of it.
    fn understood(&self) -> Result<Vec<Understood<'a>>, DeriveError> {
        let steps = self.steps.iter();
        let understood = steps.map(|Step { node, operator }| match operator {
            Ok(operator) => Ok(Understood { node, operator }),
            Err(reason) => Err(refused(node, reason.clone())),
        });
        understood.collect()
    }
}
