//! Every shader through Mesa's compiler for the Quest 3's GPU: the rules of `reasons.txt`, and the committed `table.md`.

use std::path::PathBuf;
use std::process::{Command, Output};

/// The program on the pretended GPU with `arguments`; nothing, after a line that says why, where there is none. On an x86-64 CI
/// that is a failure; other machines have no such compiler.
fn on_the_quest(arguments: &[&str]) -> Option<Output> {
    let Some(folder) = std::env::var_os("MON3TR_ADRENO") else {
        assert!(
            std::env::var("CI").as_deref() != Ok("true") || !cfg!(target_arch = "x86_64"),
            "MON3TR_ADRENO names no compiler for the Quest 3's GPU: start tests with ./run test"
        );
        println!("skipped: no compiler for the Quest 3's GPU: start tests with ./run test");
        return None;
    };
    let output = Command::new(PathBuf::from(folder).join("run"))
        .arg(env!("CARGO_BIN_EXE_adreno-table"))
        .args(arguments)
        .output()
        .expect("the compiler's wrapper starts");
    Some(output)
}

#[test]
fn no_shader_spills_or_lacks_waves_without_a_reason_and_the_committed_table_is_the_compilers() {
    let Some(output) = on_the_quest(&["--check"]) else {
        return;
    };
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn two_runs_of_the_compiler_give_the_same_statistics() {
    let Some(first) = on_the_quest(&[]) else {
        return;
    };
    let second = on_the_quest(&[]).expect("it ran before");
    assert!(
        first.status.success() && second.status.success(),
        "{}",
        String::from_utf8_lossy(&second.stderr)
    );
    assert!(first.stdout == second.stdout, "they differ");
}
