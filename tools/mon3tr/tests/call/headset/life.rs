//! A call from the headset's opening to the viewer's leaving.

use super::sight::{DISTANCE, Sight};
use super::viewer::{EYE, monado, viewer, words};
use crate::house::{House, assert_nothing_refused, assert_only_skipped, count, number};
use test_support::monado::Scripted;
use test_support::service::attended;

#[test]
fn three_hundred_frames_of_a_call_pass_all_states_and_leave_figures_and_both_eyes_pictures() {
    attended(|| {
        let Some((monado, _head)) = monado() else {
            return;
        };
        let house = House::open();
        let sender = house.sender(&[]);
        let link = sender.viewers.clone();
        let report = viewer(&house, &monado, &[&link], "viewer", &["--frames", "300"]).report();
        let sent = sender.program.ends();

        let headset = &report["headset"];
        assert_eq!(
            words(&headset["states"]),
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
        assert_eq!(count(headset, "opened"), 1, "{headset:#}");
        let frames = &headset["frames"];
        assert_eq!(count(frames, "shown"), 300, "{frames:#}");
        assert!(count(frames, "empty") < 150, "somebody came: {frames:#}");
        assert!(frames["late"].is_u64(), "late refreshes: {frames:#}");
        for times in ["interval", "period"] {
            let times = &frames[times];
            // A display of 20 Hz; no frame takes a minute.
            let (p50, max) = (number(times, "p50_ms"), number(times, "max_ms"));
            assert!(p50 > 45.0 && max < 60_000.0, "{frames:#}");
        }
        let (granted, missing) = (words(&headset["granted"]), words(&headset["missing"]));
        assert!(granted.contains(&"XR_KHR_vulkan_enable2"), "{granted:?}");
        assert!(missing.contains(&"XR_FB_passthrough"), "{missing:?}");
        assert!(
            granted.iter().all(|name| !missing.contains(name)),
            "granted or missing: {granted:?}, {missing:?}"
        );
        assert_eq!(headset["eye_size"], serde_json::json!(EYE), "{headset:#}");
        assert_eq!(headset["surround"], "a studio", "without passthrough");
        let call = &report["call"];
        assert_eq!(count(&call["received"], "sessions"), 1, "{call:#}");
        assert_only_skipped(call, &sent);
        assert_nothing_refused(call);
        assert!(monado.is_running(), "the service:\n{}", monado.log());

        let folder = house.path("viewer");
        let names: Vec<_> = words(&report["pictures"])
            .into_iter()
            .filter_map(|path| path.rsplit('/').next())
            .collect();
        assert_eq!(
            names,
            ["left.png", "right.png", "stereo.png", "moments.png"],
            "pictures"
        );
        let sight = Sight::of(&folder, &Scripted::default());
        sight.assert_stands_alone([0.0, -DISTANCE]);
        let [left, right] = sight.middles();
        // Eyes see more outwards than inwards: what is far away is not at the same place of both pictures either.
        let far = sight.disparity(1e6);
        let (apart, wanted) = (left - right - far, sight.disparity(DISTANCE) - far);
        println!("nearness moves them {apart:.2} pixels apart, {wanted:.2} by geometry");
        // They are no flat board, and move about a little.
        assert!(
            (0.75..1.35).contains(&(apart / wanted)),
            "{apart} pixels apart, {wanted} by geometry"
        );
    });
}
