use super::*;
use crate::plate::PlateBuilder;

const SIZE: [usize; 2] = [360, 180];
const SIDES: [u32; 2] = [360, 180];
const GRAIN: f32 = 4.0;

/// A noise of -1..=1 that differs from pixel to pixel.
fn noise(k: usize, frame: usize) -> f32 {
    let mixed = (k as u64 * 31 + frame as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    ((mixed >> 40) % 2001) as f32 / 1000.0 - 1.0
}

/// How much of a pixel is the person in a frame: a head, a trunk and an arm, counted at sixteen points.
fn truth(frame: usize, k: usize) -> f32 {
    let centre = 60.0 + 16.0 * frame as f32;
    let (x, y) = ((k % SIZE[0]) as f32, (k / SIZE[0]) as f32);
    let is = |x: f32, y: f32| {
        let head = ((x - centre).hypot(y - 45.0)) < 17.0;
        let trunk = (x - centre).abs() < 24.0 && (60.0..150.0).contains(&y);
        let arm =
            (centre..centre + 60.0).contains(&x) && (y - 80.0 - 0.3 * (x - centre)).abs() < 6.0;
        head || trunk || arm
    };
    let points = (0..16u8).map(|p| {
        (
            f32::from(p % 4) / 4.0 + 0.125,
            f32::from(p / 4) / 4.0 + 0.125,
        )
    });
    let hit = points.filter(|(dx, dy)| is(x + dx, y + dy)).count();
    hit as f32 / 16.0
}

/// A picture of a frame, with the mask that a network gives: blocks of a grain, the upper half of the head missing, a piece of the room beside the trunk.
fn picture(frame: usize) -> Photograph {
    let colours = |k: usize| {
        let (x, y) = (k % SIZE[0], k / SIZE[0]);
        let room = if (x / 13 + y / 17) % 2 == 0 {
            [150.0, 140.0, 130.0]
        } else {
            [60.0, 80.0, 120.0]
        };
        let skin = if y < 62 {
            [40.0, 160.0, 150.0]
        } else {
            [200.0, 150.0, 120.0]
        };
        let share = truth(frame, k);
        std::array::from_fn::<f32, 3, _>(|channel| {
            share * skin[channel]
                + (1.0 - share) * room[channel]
                + 3.0 * noise(3 * k + channel, frame)
        })
    };
    let mask = |k: usize| {
        let (x, y) = (k % SIZE[0], k / SIZE[0]);
        let block = (x / 8 * 8 + 4) + (y / 8 * 8 + 4) * SIZE[0];
        let centre = 60 + 16 * frame;
        let extra = (centre - 38..centre).contains(&x) && (110..126).contains(&y);
        let missing = y < 40;
        u8::from((truth(frame, block.min(SIZE[0] * SIZE[1] - 1)) > 0.5 && !missing) || extra) * 255
    };
    let pixels = 0..SIZE[0] * SIZE[1];
    Photograph {
        size: SIDES,
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "casts saturate"
        )]
        rgb: pixels
            .clone()
            .flat_map(|k| colours(k).map(|c| c as u8))
            .collect(),
        mask: Some(pixels.map(mask).collect()),
    }
}

fn plate(frames: usize) -> Plate {
    let mut builder = PlateBuilder::new(SIDES, frames);
    for frame in 0..frames {
        builder.add(frame, &picture(frame), GRAIN);
    }
    builder.finish()
}

/// The mean of absolute errors of shares, by pixels of the person.
fn error(mask: &[u8], frame: usize) -> f32 {
    let (mut wrong, mut person) = (0.0, 0.0);
    for (k, value) in mask.iter().enumerate() {
        let truth = truth(frame, k);
        wrong += (f32::from(*value) / 255.0 - truth).abs();
        person += truth;
    }
    wrong / person
}

#[test]
fn what_a_network_missed_and_what_it_added_are_told_by_the_background() {
    let plate = plate(15);
    for frame in [1, 7, 13] {
        let photograph = picture(frame);
        let before = error(photograph.mask.as_deref().expect("a mask"), frame);
        let mask = cut_out(&photograph, GRAIN, &plate).expect("cut out");
        let after = error(&mask, frame);
        println!(
            "frame {frame}: {:.1} % of the person wrong, {:.1} % before",
            100.0 * after,
            100.0 * before
        );
        assert!(before > 0.15, "the network's mask is wrong: {before}");
        assert!(
            after < 0.02,
            "{after} of frame {frame} is wrong, {before} before"
        );
    }
}

#[test]
fn a_person_of_the_backgrounds_colours_keeps_the_networks_mask() {
    let photograph = picture(5);
    let mut plate = plate(15);
    // The room behind is painted as the person is, from the shoulders down.
    let from = 3 * 90 * SIZE[0];
    plate.rgb[from..].copy_from_slice(&photograph.rgb[from..]);
    let mut seen = photograph.clone();
    seen.mask = Some(
        (0..SIZE[0] * SIZE[1])
            .map(|k| u8::from(truth(5, k) > 0.5) * 255)
            .collect(),
    );
    let mask = cut_out(&seen, GRAIN, &plate).expect("cut out");
    let wrong = error(&mask, 5);
    assert!(wrong < 0.08, "{wrong} of the person was lost");
}

#[test]
fn a_plate_of_another_size_or_an_empty_mask_cuts_nothing_out() {
    let mut photograph = picture(5);
    let other = PlateBuilder::new([8, 8], 1).finish();
    assert!(
        cut_out(&photograph, GRAIN, &other).is_none(),
        "another size"
    );
    photograph.mask = Some(vec![0; SIZE[0] * SIZE[1]]);
    assert!(cut_out(&photograph, GRAIN, &plate(2)).is_none(), "empty");
}
