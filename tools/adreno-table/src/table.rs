//! The table itself: which of the driver's statistics it shows, and under which heading.

use std::fmt::Write as _;

use crate::loops::Loops;
use crate::pipeline::Compiled;

/// Heading, and the driver's name for the figure.
const COLUMNS: [(&str, &str); 11] = [
    ("instructions", INSTRUCTIONS),
    ("of them nop", NOPS),
    ("registers", "Registers used"),
    ("half registers", "Half-registers used"),
    ("waves", WAVES),
    ("spills", SPILLS),
    ("reloads", RELOADS),
    ("(ss) stall", "Estimated cycles stalled on SS"),
    ("(sy) stall", "Estimated cycles stalled on SY"),
    ("memory", "cat6 instructions"),
    ("loops", "Loops"),
];

const INSTRUCTIONS: &str = "Instruction Count";
const NOPS: &str = "NOPs Count";
const SPILLS: &str = "STP Count";
const RELOADS: &str = "LDP Count";
const WAVES: &str = "Max Waves Per Core";

/// Instructions that the driver counts and does not print, or prints and does not count: four at most, six of raster_broadcast at 128, which has the most loops.
const FEW: u64 = 6;

/// One line: a stage of a shader at one subgroup size.
pub(crate) struct Row {
    name: String,
    stage: String,
    subgroup: u32,
    figures: [Option<u64>; COLUMNS.len()],
    loops: Loops,
}

impl Row {
    pub(crate) fn new(name: &str, compiled: &Compiled) -> Self {
        Self {
            name: name.to_owned(),
            stage: compiled.stage.clone(),
            subgroup: compiled.subgroup,
            figures: COLUMNS.map(|(_, statistic)| compiled.statistics.get(statistic).copied()),
            loops: Loops::read(&compiled.code),
        }
    }

    /// Shader, stage and subgroup size, which no two rows share.
    pub(crate) fn key(&self) -> String {
        format!("{} {} {}", self.name, self.stage, self.subgroup)
    }

    /// Subgroups that a core of the chip runs at once.
    pub(crate) fn waves(&self) -> Option<u64> {
        self.figure(WAVES)
    }

    fn figure(&self, statistic: &str) -> Option<u64> {
        let mut columns = COLUMNS.iter().zip(self.figures);
        columns.find_map(|((_, its), figure)| figure.filter(|_| *its == statistic))
    }

    /// Whether registers are moved to memory.
    pub(crate) fn spills(&self) -> bool {
        [SPILLS, RELOADS]
            .iter()
            .any(|statistic| self.figure(statistic) != Some(0))
    }

    /// Whether its loops account for the driver's own count: for every idle slot, and for all instructions but a few that begin and end a program.
    pub(crate) fn loops_add_up(&self) -> bool {
        let (instructions, nops) = self.loops.sums();
        self.figure(NOPS) == Some(nops)
            && (self.figure(INSTRUCTIONS)).is_some_and(|all| all.abs_diff(instructions) <= FEW)
    }

    /// A made-up row.
    #[cfg(test)]
    pub(crate) fn made_up(shader: &str, subgroup: u32, waves: u64, spills: u64) -> Self {
        let said = [
            (WAVES, waves),
            (SPILLS, spills),
            (RELOADS, spills),
            (INSTRUCTIONS, 0),
            (NOPS, 0),
        ];
        let statistics = said.map(|(name, figure)| (name.to_owned(), figure)).into();
        Self::new(
            shader,
            &Compiled {
                stage: "compute".into(),
                subgroup,
                statistics,
                code: String::new(),
            },
        )
    }
}

pub(crate) fn markdown(rows: &[Row]) -> String {
    let mut text = String::from("| shader | stage | subgroup |");
    for (heading, _) in COLUMNS {
        _ = write!(text, " {heading} |");
    }
    text += " instructions (nop) outside of loops, by loop |\n|---|---|--:|";
    text += &"--:|".repeat(COLUMNS.len());
    text += "---|\n";
    for row in rows {
        _ = write!(text, "| {} | {} | {} |", row.name, row.stage, row.subgroup);
        for figure in row.figures {
            match figure {
                Some(figure) => _ = write!(text, " {figure} |"),
                None => text += " |",
            }
        }
        _ = writeln!(text, " {} |", row.loops);
    }
    text
}
