//! A session from its first state to its last.

use test_support::monado::{Compositor, Driver, Monado};
use test_support::service::attended;

use crate::program::Program;

#[test]
fn three_hundred_frames_pass_all_states_and_end_cleanly_and_the_service_goes_on() {
    attended(|| {
        let Some(monado) = Monado::start(Driver::Simulated, Compositor::Null) else {
            return;
        };
        let program = Program::start(&monado, 300, &[]);
        let over = program.ended_well();
        assert_eq!(over["shown"], 300, "frames shown");
        let states: Vec<&str> = (over["states"].as_array().expect("a list").iter())
            .filter_map(|state| state.as_str())
            .collect();
        assert_eq!(
            states,
            [
                "idle",
                "ready",
                "synchronized",
                "visible",
                "focused",
                "visible",
                "synchronized",
                "stopping",
                "idle",
                "exiting"
            ],
            "states passed"
        );
        assert_eq!(over["opened"], 1, "the headset was opened once");
        assert_eq!(over["rises"], true, "predicted times rise");
        assert!(monado.is_running(), "the service:\n{}", monado.log());
    });
}
