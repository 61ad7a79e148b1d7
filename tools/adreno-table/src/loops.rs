//! How the instructions of a program are divided among its loops, from the machine code that the driver prints: what is executed is the
//! instructions of each loop times how often it runs, which no statistic tells.

use std::fmt;

/// Before the machine code.
const HEADING: &str = "==== IR3 Assembly";

/// Instructions that are issued once each time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Issue {
    /// All of them, as the driver counts: idle slots are some of them.
    instructions: u64,
    /// Slots in which a wave waits for its own results. Other waves may use them.
    nops: u64,
}

/// A loop: from the label that its end jumps back to.
#[derive(Debug, PartialEq, Eq)]
struct Loop {
    first: usize,
    last: usize,
    /// Its number within the loop that it is in, from 1, after that one's.
    path: String,
    issue: Issue,
}

/// A program's instructions, by loop.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Loops {
    outside: Issue,
    /// In the order in which they begin.
    loops: Vec<Loop>,
}

/// An instruction, or a label.
enum Line<'a> {
    Label(&'a str),
    Instruction {
        issue: Issue,
        name: &'a str,
        target: Option<&'a str>,
    },
}

impl Loops {
    /// Reads what [`crate::pipeline::compile`] returned with the code. What is computed once for a whole dispatch is left out, as in the driver's statistics.
    pub(crate) fn read(code: &str) -> Self {
        let code = code.rsplit_once(HEADING).map_or("", |(_, code)| code);
        let mut lines = Vec::new();
        let mut skipped_to = None;
        for line in code.lines().map(str::trim).filter_map(parse) {
            match &line {
                Line::Label(label) if skipped_to == Some(*label) => skipped_to = None,
                Line::Instruction {
                    name: "shps",
                    target,
                    ..
                } => skipped_to = *target,
                _ => {}
            }
            if skipped_to.is_none() {
                let is_end = matches!(&line, Line::Instruction { name: "end", .. });
                lines.push(line);
                if is_end {
                    break;
                }
            }
        }
        Self::of(&lines)
    }

    /// All instructions, and the idle slots among them.
    pub(crate) fn sums(&self) -> (u64, u64) {
        let issues =
            || std::iter::once(&self.outside).chain(self.loops.iter().map(|one| &one.issue));
        (
            issues().map(|issue| issue.instructions).sum(),
            issues().map(|issue| issue.nops).sum(),
        )
    }

    fn of(lines: &[Line<'_>]) -> Self {
        let label_at = |wanted: &str| {
            (lines.iter()).position(|line| matches!(line, Line::Label(label) if *label == wanted))
        };
        let mut spans: Vec<(usize, usize)> = Vec::new();
        for (at, line) in lines.iter().enumerate() {
            let Line::Instruction {
                target: Some(target),
                ..
            } = line
            else {
                continue;
            };
            let Some(start) = label_at(target).filter(|start| *start < at) else {
                continue;
            };
            // Several jumps back to one label are one loop, up to the last of them.
            match spans.iter_mut().find(|(first, _)| *first == start) {
                Some((_, last)) => *last = at,
                None => spans.push((start, at)),
            }
        }
        // The outer before the inner.
        spans.sort_by_key(|(first, last)| (*first, std::cmp::Reverse(*last)));
        let mut loops: Vec<Loop> = Vec::new();
        for (first, last) in spans {
            let parent = loops
                .iter()
                .rfind(|outer| outer.first <= first && last <= outer.last);
            let prefix = parent.map_or(String::new(), |outer| format!("{}.", outer.path));
            let siblings = loops.iter().filter(|other| {
                (other.path.strip_prefix(prefix.as_str())).is_some_and(|rest| !rest.contains('.'))
            });
            let path = format!("{prefix}{}", siblings.count() + 1);
            loops.push(Loop {
                first,
                last,
                path,
                issue: Issue::default(),
            });
        }
        let mut outside = Issue::default();
        for (at, line) in lines.iter().enumerate() {
            let Line::Instruction { issue, .. } = line else {
                continue;
            };
            let innermost = loops
                .iter_mut()
                .rfind(|one| one.first <= at && at <= one.last);
            let into = innermost.map_or(&mut outside, |one| &mut one.issue);
            into.instructions += issue.instructions;
            into.nops += issue.nops;
        }
        Self { outside, loops }
    }
}

/// Nothing for what is neither.
fn parse(line: &str) -> Option<Line<'_>> {
    if line.is_empty() || line.starts_with([';', '@']) {
        return None;
    }
    if let Some(label) = line.strip_suffix(':') {
        return Some(Line::Label(label));
    }
    // `(ss)(nop2) mad.f32 ...`: repetitions and idle slots are among the marks before the name.
    let (mut rest, mut repeats, mut idle) = (line, 0, 0);
    while let Some((mark, after)) = rest.strip_prefix('(').and_then(|rest| rest.split_once(')')) {
        let number = |name| {
            mark.strip_prefix(name)
                .and_then(|number| number.parse().ok())
        };
        repeats = number("rpt").unwrap_or(repeats);
        idle = number("nop").unwrap_or(idle);
        rest = after.trim_start();
    }
    let name = rest.split_whitespace().next()?;
    let nops = if name == "nop" { 1 + repeats } else { idle };
    let own = if name == "nop" { 0 } else { 1 + repeats };
    Some(Line::Instruction {
        issue: Issue {
            instructions: own + nops,
            nops,
        },
        name,
        target: rest.split_once('#').map(|(_, target)| target.trim()),
    })
}

impl fmt::Display for Issue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.instructions, self.nops)
    }
}

/// Instructions and, in brackets, idle slots: outside of loops, then of each loop without those in it.
impl fmt::Display for Loops {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.outside)?;
        for one in &self.loops {
            write!(f, ", {}: {}", one.path, one.issue)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_are_counted_once_in_the_innermost_loop() {
        let code = "==== NIR\njump #l9\n==== IR3 Assembly\n; constants\n@in(r0.x)\tin0\nshps #l1\nmov r0, c1\nl1:\n\
            (ss)(nop2) add.f r0.x, r1.x, r2.x\nl2:\n(rpt1)nop\nbr p0.x, #l5\nl3:\n(rpt2)mov.u32u32 r1.x, 0\nbr !p0.y, #l3\n\
            jump #l2\nl4:\nmul.f r0.x, r0.x, r0.y\njump #l4\nl5:\nend\nnop\n";
        // Before the loops an addition with two idle slots, after them the end. In the first loop two idle slots and two jumps, in the one
        // within it three moves and a jump; in the second a product and a jump.
        assert_eq!(
            Loops::read(code).to_string(),
            "4 (2), 1: 4 (2), 1.1: 4 (0), 2: 2 (0)"
        );
    }

    #[test]
    fn no_code_is_no_instructions() {
        assert_eq!(Loops::read("").to_string(), "0 (0)");
        assert_eq!(
            Loops::read("==== NIR\nblock: jump #l2").to_string(),
            "0 (0)"
        );
    }
}
