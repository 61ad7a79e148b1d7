//! Where stages run: the chosen placement and why, the alternatives, and what was not available.

use super::{COLUMNS, HEADING};
use app_pipeline::placement::{Alternative, PlacementReport};
use app_pipeline::stage::{Stage, Unit};

/// The placement, and why it was chosen.
pub(super) fn chosen(placement: &PlacementReport) -> Vec<String> {
    let mut lines = headed(
        "placement",
        &format!(
            "{} (asked for: {}): {}",
            placement.name(),
            placement.requested,
            placement.reason
        ),
    );
    for unit in Unit::ALL {
        let its = placement.units.iter().filter(|(_, on)| *on == unit);
        let names: Vec<&str> = its.map(|(stage, _)| short(*stage)).collect();
        if !names.is_empty() {
            lines.extend(headed(
                "",
                &format!("{}: {}", unit.name(), names.join(", ")),
            ));
        }
    }
    if let (Some(form), Some(landing)) = (placement.graph, &placement.landing) {
        let form = format!("{form:?}").to_lowercase();
        lines.extend(headed("", &format!("graph: {form}, nodes on {landing}")));
    }
    lines
}

/// The alternatives: times of what was tried, reasons for what was not.
pub(super) fn tried(placement: &PlacementReport) -> Vec<String> {
    let mut lines = Vec::new();
    let times = placement.alternatives.iter().filter_map(|one| {
        let costs = one.costs.as_ref()?;
        Some((one, costs, one.predicted_ms?))
    });
    for (one, costs, predicted) in times {
        if lines.is_empty() {
            lines.push(format!(
                "{:<29} {:>9} {:>9} {:>12} {:>9} {:>13}",
                "placement, ms", "inference", "bind", "interpolate", "draw", "picture after"
            ));
        }
        let is_chosen = placement.is_chosen(one);
        lines.push(format!(
            "{:<29} {:>9.2} {:>9.2} {:>12.2} {:>9.2} {predicted:>13.2}{}",
            one.name(),
            costs.inference,
            costs.bind,
            costs.interpolate,
            costs.draw,
            if is_chosen { "   <- chosen" } else { "" }
        ));
    }
    let mut reasons: Vec<&str> = Vec::new();
    for reason in placement.alternatives.iter().filter_map(refusal) {
        if !reasons.contains(&reason) {
            reasons.push(reason);
        }
    }
    for reason in reasons {
        let refused = refused_for(&placement.alternatives, reason).join(", ");
        let reason: Vec<&str> = reason.split_whitespace().collect();
        lines.extend(wrapped(
            "",
            4,
            &format!("not {refused}: {}", reason.join(" ")),
        ));
    }
    lines
}

fn refusal(one: &Alternative) -> Option<&str> {
    one.refused.as_deref()
}

/// The plans with this refusal; a provider, if all of its plans have it.
fn refused_for(alternatives: &[Alternative], reason: &str) -> Vec<String> {
    let mut names = Vec::new();
    for of_provider in alternatives.chunk_by(|one, next| one.provider == next.provider) {
        let mut refused = of_provider
            .iter()
            .filter(|one| refusal(one) == Some(reason))
            .peekable();
        let Some(first) = refused.peek() else {
            continue;
        };
        let provider = first.provider;
        match provider {
            Some(provider) if of_provider.iter().all(|one| refusal(one) == Some(reason)) => {
                names.push(provider.to_string());
            }
            _ => {
                let plans: Vec<&str> = refused.map(|one| one.plan.name()).collect();
                let on = provider.map_or_else(String::new, |provider| format!(" on {provider}"));
                names.push(plans.join(", ") + &on);
            }
        }
    }
    names
}

/// A stage's name without its abbreviation.
fn short(stage: Stage) -> &'static str {
    let name = stage.name();
    name.split_once(" (").map_or(name, |(short, _)| short)
}

/// Lines of `text`, indented but for `heading` before the first.
pub(crate) fn headed(heading: &str, text: &str) -> Vec<String> {
    wrapped(heading, HEADING, text)
}

/// Lines of `text`, each `indented`, with `heading` before the first.
fn wrapped(heading: &str, indented: usize, text: &str) -> Vec<String> {
    let mut lines = vec![format!("{heading:<indented$}")];
    let mut is_empty = true;
    for word in text.split_whitespace() {
        let line = lines.last().map_or(0, |line| line.chars().count());
        if !is_empty && line + 1 + word.chars().count() > COLUMNS {
            lines.push(" ".repeat(indented));
            is_empty = true;
        }
        if let Some(line) = lines.last_mut() {
            if !is_empty {
                line.push(' ');
            }
            line.push_str(word);
            is_empty = false;
        }
    }
    lines
}
