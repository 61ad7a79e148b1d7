//! Losses during a session: the service, its answers, the focus.

use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;
use test_support::monado::{Compositor, Driver, Monado};
use test_support::service::attended;

use crate::program::Program;

#[test]
fn a_service_that_is_killed_is_a_loss_and_the_program_shows_frames_again_when_it_is_back() {
    attended(|| {
        let Some(mut monado) = Monado::start(Driver::Remote, Compositor::Null) else {
            return;
        };
        let mut program = Program::start(&monado, u64::MAX, &["--steered", "--reopens"]);
        let before = program.wait_for_frames(10)["frames"].as_u64();
        monado.kill();
        let lost = program.wait_for("lost", |_| true);
        assert_eq!(lost["is_loss"], true, "{lost}");
        let why = lost["error"].as_str().expect("a text");
        assert!(why.contains("open the headset again"), "advice: {why}");
        // While there is no service, opening fails with an error that may pass.
        let absent = program.wait_for("lost", |_| true);
        let why = absent["error"].as_str().expect("a text");
        assert!(why.contains("service is not running"), "meanwhile: {why}");
        monado.restart();
        program.wait_for("opened", |line| line["times"] == 2);
        let after = program.wait_for("shown", |line| {
            line["times"] == 2 && line["life"] == "focused"
        });
        assert!(after["frames"].as_u64() > before, "{after}");
        // The new session's head follows the new service.
        program.ask("tell", "again");
        program.end();
        let over = program.ended_well();
        assert_eq!(over["opened"], 2, "{over}");
        assert!(monado.is_running(), "the new service");
    });
}

#[test]
fn without_opening_again_a_killed_service_ends_the_program_with_advice() {
    attended(|| {
        let Some(mut monado) = Monado::start(Driver::Simulated, Compositor::Null) else {
            return;
        };
        let mut program = Program::start(&monado, u64::MAX, &["--figure=none"]);
        program.wait_for_frames(5);
        monado.kill();
        let ended = program.ended();
        assert_eq!(ended.status.code(), Some(1), "{}", ended.errors);
        let last = ended.last();
        assert_eq!(last["event"], "failed", "{last}");
        assert_eq!(last["is_loss"], true, "{last}");
    });
}

#[test]
fn a_service_that_stands_still_for_three_seconds_goes_on_with_the_same_session() {
    attended(|| {
        let Some(monado) = Monado::start(Driver::Simulated, Compositor::Null) else {
            return;
        };
        let mut program = Program::start(&monado, u64::MAX, &["--steered", "--reopens"]);
        let before = program.wait_for_frames(10)["frames"].as_u64();
        monado.pause();
        sleep(Duration::from_secs(3));
        monado.go_on();
        let wanted = before.map_or(0, |frames| frames + 20);
        program.wait_for_frames(wanted);
        program.end();
        let over = program.ended_well();
        assert_eq!(over["opened"], 1, "the same session: {over}");
        assert_eq!(over["rises"], true, "predicted times rise over the pause");
    });
}

#[test]
fn of_two_programs_at_once_both_end_cleanly_and_at_least_one_is_seen_to_the_end() {
    attended(|| {
        let Some(monado) = Monado::start(Driver::Simulated, Compositor::Null) else {
            return;
        };
        let mut first = Program::start(&monado, u64::MAX, &["--steered", "--figure=none"]);
        first.wait_for_frames(5);
        let mut second = Program::start(&monado, u64::MAX, &["--steered", "--figure=none"]);
        second.wait_for("opened", |_| true);
        // At least one program's frames go on.
        let mut seen = 0;
        for _ in 0..200 {
            seen = first.frames().max(second.frames());
            if seen >= 60 {
                break;
            }
            sleep(Duration::from_millis(500));
        }
        assert!(seen >= 60, "frames seen of one: {seen}");
        first.end();
        let first = first.ended_well();
        second.end();
        let second = second.ended_well();
        for over in [&first, &second] {
            let last = over["states"].as_array().and_then(|states| states.last());
            assert_eq!(last, Some(&Value::from("exiting")), "{over}");
        }
        assert!(monado.is_running(), "the service:\n{}", monado.log());
    });
}
