use super::*;
use std::cell::Cell;

/// A shell that runs this.
fn shell(name: &'static str, does: &str, log: &Path) -> Service {
    let mut command = Command::new("sh");
    Service::start(name, command.args(["-c", does]), log, None)
}

fn has_ended(service: &Service) {
    while service.is_running() {
        sleep(LOOK);
    }
}

#[test]
fn a_death_is_noticed_and_reported_with_the_last_output() {
    let folder = tempfile::tempdir().expect("a folder");
    let service = shell(
        "sleeper",
        "echo last words; kill -SEGV $$",
        &folder.path().join("log"),
    );
    has_ended(&service);
    let failure = catch_unwind(assert_all_live).expect_err("it is told");
    let text = failure.downcast_ref::<String>().expect("a text");
    for part in ["sleeper ended by itself", "signal: 11", "last words"] {
        assert!(text.contains(part), "{part} in: {text}");
    }
}

#[test]
fn a_program_ended_on_purpose_or_with_an_allowed_success_has_not_died() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log");
    let killed = shell("killed", "sleep 60", &log);
    killed.kill();
    let display = shell("display", "true", &log);
    display.may_end();
    has_ended(&display);
    assert_all_live();
    let fails = shell("fails", "exit 3", &log);
    fails.may_end();
    has_ended(&fails);
    assert!(fails.death().is_some(), "this one has");
}

#[test]
fn a_test_whose_program_dies_is_run_again_twice_and_no_more() {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log");
    // It dies so many times, then it lives.
    let run = |deaths: u32| {
        let runs = Cell::new(0);
        let result = catch_unwind(AssertUnwindSafe(|| {
            attended(|| {
                runs.set(runs.get() + 1);
                let dies = runs.get() <= deaths;
                let service = shell("mortal", if dies { "exit 9" } else { "sleep 60" }, &log);
                while dies && service.is_running() {
                    sleep(LOOK);
                }
                assert_all_live();
            });
        }));
        (runs.get(), result.is_ok())
    };
    assert_eq!(run(0), (1, true), "no program dies");
    assert_eq!(run(2), (3, true), "twice");
    assert_eq!(run(3), (3, false), "every time");
}

#[test]
fn a_failure_without_a_death_is_not_retried() {
    let folder = tempfile::tempdir().expect("a folder");
    let runs = Cell::new(0);
    let result = catch_unwind(AssertUnwindSafe(|| {
        attended(|| {
            runs.set(runs.get() + 1);
            let _service = shell("lives", "sleep 60", &folder.path().join("log"));
            panic!("another reason");
        });
    }));
    assert!(result.is_err(), "it fails");
    assert_eq!(runs.get(), 1, "once");
}

#[test]
fn a_program_that_a_signal_ends_is_run_again_and_one_that_fails_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let mark = folder.path().join("mark");
    let mut command = Command::new("sh");
    command.args([
        "-c",
        "echo run >>$0; [ $(wc -l <$0) -gt 1 ] || kill -ABRT $$; exit 3",
    ]);
    let ended = output("aborts", command.arg(&mark));
    assert_eq!(ended.status.code(), Some(3), "its own end");
    let runs = std::fs::read_to_string(mark).expect("a mark");
    assert_eq!(runs.lines().count(), 2, "the second run");
}
