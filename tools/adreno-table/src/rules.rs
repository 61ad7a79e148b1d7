//! The limits of a shader's cost: no spills, and as many waves as a core holds, unless a reason is written down.

use anyhow::{Context, bail, ensure};

use crate::table::Row;

/// The waves that one core of the chip holds: with fewer, less memory latency is hidden.
const ALL_WAVES: u64 = 16;

/// A line of the file of reasons: a row of the table, and why it has too few waves.
pub(crate) struct Reason {
    row: String,
    why: String,
}

/// Reads lines of `SHADER STAGE SUBGROUP: WHY`; empty ones, and those that begin with `#`, are skipped.
pub(crate) fn reasons(text: &str) -> anyhow::Result<Vec<Reason>> {
    let mut reasons: Vec<Reason> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (row, why) = line
            .split_once(": ")
            .with_context(|| format!("line {number} is not SHADER STAGE SUBGROUP: WHY"))?;
        ensure!(
            row.split(' ').count() == 3,
            "line {number} does not begin with SHADER STAGE SUBGROUP"
        );
        ensure!(
            reasons.iter().all(|one| one.row != row),
            "line {number}: {row} has a reason already"
        );
        reasons.push(Reason {
            row: row.to_owned(),
            why: why.trim().to_owned(),
        });
    }
    Ok(reasons)
}

/// Fails on everything that breaks a rule, all of it at once.
pub(crate) fn check(rows: &[Row], reasons: &[Reason]) -> anyhow::Result<()> {
    let mut wrong = Vec::new();
    for row in rows {
        let (key, reason) = (row.key(), reasons.iter().find(|one| one.row == row.key()));
        if !row.loops_add_up() {
            wrong.push(format!(
                "the loops of {key} were misread: their instructions are not as many as the driver counts"
            ));
        }
        if row.spills() {
            wrong.push(format!("{key} spills registers to memory"));
        }
        match (row.waves(), reason) {
            (None, _) => wrong.push(format!(
                "the driver does not tell how many waves {key} runs in"
            )),
            (Some(waves), None) if waves < ALL_WAVES => wrong.push(format!(
                "{key} runs in {waves} waves, not {ALL_WAVES}, and no reason is given"
            )),
            (Some(waves), Some(_)) if waves >= ALL_WAVES => wrong.push(format!(
                "{key} runs in all {ALL_WAVES} waves: its reason for fewer is out of date"
            )),
            _ => {}
        }
    }
    for Reason { row, why } in reasons {
        if rows.iter().all(|one| one.key() != *row) {
            wrong.push(format!("there is no {row}, which has a reason: {why}"));
        }
    }
    if wrong.is_empty() {
        return Ok(());
    }
    bail!("{}", wrong.join("\n"))
}

/// Fails where `committed` differs from `now`, and names the lines.
pub(crate) fn check_table(committed: &str, now: &str) -> anyhow::Result<()> {
    if committed == now {
        return Ok(());
    }
    let only_in = |one: &str, other: &str, sign: char| -> Vec<String> {
        let others: Vec<&str> = other.lines().collect();
        let lines = one.lines().filter(|line| !others.contains(line));
        lines.map(|line| format!("{sign} {line}")).collect()
    };
    let mut lines = only_in(committed, now, '-');
    lines.extend(only_in(now, committed, '+'));
    bail!(
        "the committed table is not what the compiler says now; \
         look whether that is as it should be, then write it anew: android/adreno.sh --renew\n{}",
        lines.join("\n")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(shader: &str, waves: u64, spills: u64) -> Row {
        Row::made_up(shader, 64, waves, spills)
    }

    fn said(rows: &[Row], written: &str) -> String {
        let reasons = reasons(written).expect("a file of reasons");
        check(rows, &reasons).map_or_else(|why| why.to_string(), |()| String::new())
    }

    #[test]
    fn a_shader_with_all_waves_and_no_spills_passes() {
        assert_eq!(
            said(&[row("sort_count", 16, 0)], "# none"),
            "",
            "it is fine"
        );
    }

    #[test]
    fn a_spill_fails_even_with_a_reason() {
        let said = said(
            &[row("raster", 12, 3)],
            "raster compute 64: it has much to remember",
        );
        assert_eq!(
            said, "raster compute 64 spills registers to memory",
            "no reason excuses it"
        );
    }

    #[test]
    fn too_few_waves_need_a_reason_and_all_waves_must_not_have_one() {
        let narrow = [row("raster", 12, 0)];
        assert!(said(&narrow, "").contains("no reason is given"), "12 waves");
        assert_eq!(
            said(&narrow, "raster compute 64: sums"),
            "",
            "12 waves with a reason"
        );
        let said = said(&[row("raster", 16, 0)], "raster compute 64: sums");
        assert!(said.contains("out of date"), "{said}");
    }

    #[test]
    fn a_reason_for_a_removed_shader_fails() {
        let said = said(&[row("raster", 16, 0)], "rooster compute 64: it crows");
        assert!(said.contains("there is no rooster compute 64"), "{said}");
    }

    #[test]
    fn a_line_that_is_no_reason_is_refused_by_its_number() {
        for (text, line) in [
            ("\nraster compute 64", 2),
            ("raster: why", 1),
            ("a b 1: c\na b 1: d", 2),
        ] {
            let why = reasons(text)
                .err()
                .map(|why| why.to_string())
                .unwrap_or_default();
            assert!(why.starts_with(&format!("line {line}")), "{text:?}: {why}");
        }
    }

    #[test]
    fn lines_that_differ_from_the_committed_table_are_printed_from_both() {
        let why = check_table("same\nold\n", "same\nnew\n")
            .expect_err("they differ")
            .to_string();
        assert!(why.ends_with("\n- old\n+ new"), "{why}");
    }
}
