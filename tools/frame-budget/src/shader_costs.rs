//! How many instructions a shader issues, by the table that `android/adreno.sh` writes.

use crate::estimate::Estimate;

/// `tools/adreno-table/table.md`: the compiler's figures for each shader.
const TABLE: &str = include_str!("../../adreno-table/table.md");

/// Why the table cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// A shader is not in it, or not as the model knows it.
    #[error(
        "tools/adreno-table/table.md has no {shader} with {what}: a shader has changed, and the model with it must"
    )]
    Missing {
        /// Its name, stage and subgroup size.
        shader: String,
        /// What the model asked for.
        what: String,
    },
}

/// Instructions of one loop, or outside of all, each time it runs.
#[derive(Debug, Clone)]
struct Part {
    /// Empty outside of loops, else like `1.2`.
    path: String,
    instructions: f64,
    nops: f64,
}

/// One shader's instructions.
#[derive(Debug, Clone)]
struct Shader {
    key: String,
    parts: Vec<Part>,
}

/// What every shader issues.
#[derive(Debug, Clone)]
pub struct ShaderCosts(Vec<Shader>);

impl ShaderCosts {
    /// Of the committed table.
    #[must_use]
    pub fn of_table() -> Self {
        Self(TABLE.lines().filter_map(shader).collect())
    }

    /// Instructions that waves of the shader `key` (name, stage, subgroup size) issue, if each of its loops runs as often as `runs` says, by path; outside of loops
    /// it is the empty path. The least is without the slots in which a wave waits for itself, the most with all of them, and a quarter of them is
    /// likely: other waves use the rest.
    ///
    /// # Errors
    /// If the table has no such shader, or other loops.
    pub fn issued(&self, key: &str, runs: &[(&str, f64)]) -> Result<Estimate, TableError> {
        let missing = |what: String| TableError::Missing {
            shader: key.to_owned(),
            what,
        };
        let shader = (self.0.iter().find(|shader| shader.key == key))
            .ok_or_else(|| missing("this name".to_owned()))?;
        if shader.parts.len() != runs.len() {
            return Err(missing(format!("{} loops", runs.len().saturating_sub(1))));
        }
        let mut all = Estimate::NONE;
        for (path, runs) in runs {
            let part = (shader.parts.iter().find(|part| part.path == *path))
                .ok_or_else(|| missing(format!("a loop {path}")))?;
            let busy = part.instructions - part.nops;
            all = all + Estimate::new(busy, busy + 0.25 * part.nops, part.instructions) * *runs;
        }
        Ok(all)
    }
}

/// A row of the table; nothing for other lines.
fn shader(line: &str) -> Option<Shader> {
    let cells: Vec<&str> = line
        .trim()
        .trim_matches('|')
        .split('|')
        .map(str::trim)
        .collect();
    let [name, stage, subgroup, .., by_loop] = cells.as_slice() else {
        return None;
    };
    subgroup.parse::<u32>().ok()?;
    let parts = by_loop.split(", ").map(|part| {
        let (path, counts) = part.split_once(": ").unwrap_or(("", part));
        let (instructions, nops) = counts.strip_suffix(')')?.split_once(" (")?;
        Some(Part {
            path: path.to_owned(),
            instructions: instructions.parse().ok()?,
            nops: nops.parse().ok()?,
        })
    });
    Some(Shader {
        key: format!("{name} {stage} {subgroup}"),
        parts: parts.collect::<Option<_>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_are_multiplied_by_the_runs_of_their_loop() {
        let row = "| thing | compute | 64 | 9 | 10 (4), 1: 20 (8), 1.1: 5 (0) |";
        let costs = ShaderCosts(shader(row).into_iter().collect());
        let issued = costs
            .issued("thing compute 64", &[("", 1.0), ("1", 2.0), ("1.1", 100.0)])
            .expect("it is there");
        // 6 + 2 x 12 + 100 x 5; 10 + 2 x 20 + 500.
        assert_eq!((issued.least, issued.most), (530.0, 550.0));
        assert_eq!(issued.likely, 535.0);
        for (key, runs) in [
            ("other compute 64", &[("", 1.0)][..]),
            ("thing compute 64", &[("", 1.0)]),
            ("thing compute 64", &[("", 1.0), ("1", 1.0), ("2", 1.0)]),
        ] {
            assert!(costs.issued(key, runs).is_err(), "{key} {runs:?}");
        }
    }

    #[test]
    fn the_committed_table_is_read() {
        let costs = ShaderCosts::of_table();
        assert!(costs.0.len() > 30, "{}", costs.0.len());
    }
}
