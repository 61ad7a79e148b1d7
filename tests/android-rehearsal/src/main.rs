//! The driver of the rehearsal: builds what is needed, performs the cases one after another, and reports each result.

mod app;
mod cases;
mod device;
mod environment;
mod process;
mod report;
mod screenshot;

use anyhow::{Context, ensure};
use cases::{CASES, Case, Figures};
use clap::Parser;
use environment::Environment;
use report::{Performed, Report};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;
use test_support::monado::Compositor;
use test_support::service::attended;

/// Execute the headset's app on this machine, without Android, and put it through the cases
#[derive(Debug, Parser)]
struct Options {
    /// Write the results of the cases as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Perform only this case; may be given several times
    #[arg(long, value_name = "NAME")]
    case: Vec<String>,
    /// Run a command, with the rehearsal as the device that its adb sees, and no case
    #[arg(long, value_name = "COMMAND", num_args = 1.., allow_hyphen_values = true, conflicts_with = "case")]
    device: Vec<String>,
}

fn main() -> anyhow::Result<ExitCode> {
    let options = Options::parse();
    let chosen = chosen(&options.case)?;
    let repo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let repo = repo.canonicalize().context("the repository is gone")?;
    let begun = Instant::now();
    let app = app::build_app(&repo)?;
    let shims = repo.join("target/android-rehearsal/shims");
    android_rehearsal::shims::build(&shims)?;
    let mut report = Report {
        build_seconds: begun.elapsed().as_secs_f64(),
        cases: Vec::new(),
    };
    let environment = Environment::new(&repo, app, shims)?;
    if let [program, arguments @ ..] = options.device.as_slice() {
        let scene = environment.scene("device", Compositor::Null)?;
        let status = device::execute(scene, Command::new(program).args(arguments))?;
        let code = status.code().and_then(|code| u8::try_from(code).ok());
        return Ok(code.map_or(ExitCode::FAILURE, ExitCode::from));
    }
    for case in chosen {
        let performed = perform(case, &environment);
        performed.print();
        report.cases.push(performed);
    }
    if let Some(file) = &options.json {
        report.write(file)?;
    }
    let failed = report.failed();
    println!("\n{} passed, {failed} failed", report.cases.len() - failed);
    if failed != 0 {
        println!(
            "logs are in {}, a folder a case",
            environment.left.display()
        );
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

/// The cases of these names; all of them for none.
fn chosen(names: &[String]) -> anyhow::Result<Vec<&'static Case>> {
    for name in names {
        ensure!(
            CASES.iter().any(|case| case.name == *name),
            "there is no case {name}; there are {}",
            CASES.map(|case| case.name).join(", ")
        );
    }
    let is_chosen = |case: &&Case| names.is_empty() || names.iter().any(|name| name == case.name);
    Ok(CASES.iter().filter(is_chosen).collect())
}

/// Performs a case on a thread of its own: what it starts with is gone afterwards, also where it panics.
fn perform(case: &'static Case, environment: &Environment) -> Performed {
    let begun = Instant::now();
    let outcome = std::thread::scope(|scope| {
        let thread = scope.spawn(|| attended(|| (case.perform)(environment, case.name)));
        thread.join().unwrap_or_else(|panic| {
            let message = panic.downcast_ref::<String>().map(String::as_str);
            let message = message.or(panic.downcast_ref::<&str>().copied());
            Err(anyhow::anyhow!("{}", message.unwrap_or("it panicked")))
        })
    });
    let (figures, failure) = match outcome {
        Ok(figures) => (figures, None),
        Err(error) => (Figures::new(), Some(format!("{error:#}"))),
    };
    Performed {
        name: case.name,
        shows: case.shows,
        passed: failure.is_none(),
        failure,
        seconds: begun.elapsed().as_secs_f64(),
        figures,
    }
}
