//! Random hands, posed by forward kinematics of this test's own, are found again; and what a network saw on renders of known hands.

#![allow(clippy::cast_possible_truncation, reason = "small random numbers")]

use super::*;
use glam::{DMat3, Vec2, Vec3};
use spmm3::JOINTS;

/// Rest positions of a left hand relative to its wrist, metres: the three joints of index, middle, pinky, ring, thumb.
const REST: [[[f64; 3]; 3]; 5] = [
    [
        [0.1140, -0.0056, 0.0287],
        [0.1425, -0.0078, 0.0319],
        [0.1681, -0.0111, 0.0346],
    ],
    [
        [0.1134, 0.0, 0.0],
        [0.1509, -0.0036, -0.0045],
        [0.1805, -0.0073, -0.0076],
    ],
    [
        [0.0961, -0.0056, -0.0420],
        [0.1178, -0.0080, -0.0504],
        [0.1338, -0.0105, -0.0564],
    ],
    [
        [0.1066, 0.0006, -0.0214],
        [0.1386, -0.0025, -0.0302],
        [0.1650, -0.0055, -0.0369],
    ],
    [
        [0.0418, -0.0032, 0.0270],
        [0.0536, -0.0274, 0.0485],
        [0.0810, -0.0476, 0.0705],
    ],
];
/// Landmark of each finger's root, in the same order.
const LANDMARK: [usize; 5] = [5, 9, 17, 13, 1];

/// Numbers of a linear congruential generator.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn rotation(&mut self) -> DMat3 {
        let axis = DVec3::from_array(std::array::from_fn(|_| self.within(-1.0, 1.0)));
        about(axis, self.within(0.0, 3.1))
    }
}

/// Rodrigues' formula.
fn about(axis: DVec3, angle: f64) -> DMat3 {
    let k = axis.normalize();
    let cross = DMat3::from_cols(
        DVec3::new(0.0, k.z, -k.y),
        DVec3::new(-k.z, 0.0, k.x),
        DVec3::new(k.y, -k.x, 0.0),
    );
    DMat3::IDENTITY + cross * angle.sin() + cross * cross * (1.0 - angle.cos())
}

fn mirror(side: Side) -> DVec3 {
    match side {
        Side::Left => DVec3::ONE,
        Side::Right => DVec3::new(-1.0, 1.0, 1.0),
    }
}

fn rest(side: Side) -> [[DVec3; 3]; 5] {
    REST.map(|finger| finger.map(|p| DVec3::from_array(p) * mirror(side)))
}

fn skeleton() -> Skeleton {
    let mut positions = [Vec3::ZERO; JOINTS];
    for side in [Side::Left, Side::Right] {
        let wrist = DVec3::new(0.72, 1.42, 0.03) * mirror(side);
        let elbow = DVec3::new(0.47, 1.42, 0.02) * mirror(side);
        let (hub, above) = match side {
            Side::Left => (Joint::LeftWrist, Joint::LeftElbow),
            Side::Right => (Joint::RightWrist, Joint::RightElbow),
        };
        positions[hub.index()] = wrist.as_vec3();
        positions[above.index()] = elbow.as_vec3();
        let first = side.first_finger_joint().index();
        for (k, offset) in rest(side).iter().flatten().enumerate() {
            positions[first + k] = (wrist + *offset).as_vec3();
        }
    }
    Skeleton::new(positions).expect("in range")
}

/// Axes of each joint as the module's documentation has them: of flexion and of abduction.
fn axes(side: Side, finger: usize, joint: usize) -> [DVec3; 2] {
    let hand = rest(side);
    let [first, second, third] = hand[finger];
    let bones = [second - first, third - second, third - second].map(DVec3::normalize);
    let square = |v: DVec3, to: DVec3| (v - to * v.dot(to)).normalize();
    let inward = if finger == 4 {
        hand[2][0] - second
    } else {
        let knuckles = (hand[0][0] + hand[1][0] + hand[2][0] + hand[3][0]) / 4.0;
        let along = knuckles.normalize();
        let across = square(hand[0][0] - hand[2][0], along);
        let palm = along.cross(across);
        if side == Side::Left { palm } else { -palm }
    };
    let curl = bones[0].cross(square(inward, bones[0]));
    if finger == 4 {
        let curl = square(curl, bones[joint]);
        [curl, bones[joint].cross(curl)]
    } else {
        [curl, bones[0].cross(curl)]
    }
}

/// Random joint rotations within the limits of a hand.
fn random_fingers(random: &mut Random, side: Side) -> [[DMat3; 3]; 5] {
    std::array::from_fn(|finger| {
        let mut degrees = |low, high| random.within(low, high).to_radians();
        let (flexion, abduction) = if finger == 4 {
            (
                [
                    degrees(-29.0, 44.0),
                    degrees(-14.0, 59.0),
                    degrees(-19.0, 79.0),
                ],
                [degrees(-39.0, 39.0), degrees(-14.0, 14.0), 0.0],
            )
        } else {
            let second = degrees(1.0, 109.0);
            let third = second * 2.0 / 3.0 + degrees(-29.0, 29.0);
            let third = third.clamp(0.02, 1.39);
            // Beyond 85 degrees the bones hardly show the abduction.
            (
                [degrees(-19.0, 85.0), second, third],
                [degrees(-19.0, 19.0), 0.0, 0.0],
            )
        };
        std::array::from_fn(|joint| {
            let [curl, across] = axes(side, finger, joint);
            about(across, abduction[joint]) * about(curl, flexion[joint])
        })
    })
}

/// Landmarks of a hand with these joint rotations, seen from anywhere at any scale.
fn landmarks(
    random: &mut Random,
    side: Side,
    fingers: &[[DMat3; 3]; 5],
    noise: f64,
) -> (HandLandmarks, DMat3) {
    let turn = random.rotation();
    let scale = random.within(0.6, 1.6);
    let mut points = [DVec3::ZERO; HAND_LANDMARKS];
    for (finger, joints) in rest(side).into_iter().enumerate() {
        let tip = joints[2] + (joints[2] - joints[1]) * 0.9;
        let ends = [joints[1], joints[2], tip];
        let mut at = joints[0];
        let mut rotation = DMat3::IDENTITY;
        points[LANDMARK[finger]] = at;
        for k in 0..3 {
            rotation *= fingers[finger][k];
            at += rotation * (ends[k] - joints[k]);
            points[LANDMARK[finger] + k + 1] = at;
        }
    }
    let shift = DVec3::new(0.03, -0.02, 0.05);
    let seen = points.map(|p| {
        let shake = DVec3::from_array(std::array::from_fn(|_| random.within(-noise, noise)));
        turn * (p + shake) * scale + shift
    });
    let hand = HandLandmarks {
        pixels: seen.map(|p| (p * 1000.0).truncate().as_vec2()),
        metres: seen.map(|p| p.as_vec3()),
        confidence: 1.0,
    };
    (hand, turn)
}

fn degrees_between(a: DMat3, b: DQuat) -> f64 {
    let relative = a.transpose() * DMat3::from_quat(b);
    let trace = relative.x_axis.x + relative.y_axis.y + relative.z_axis.z;
    ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
}

#[test]
fn random_hands_within_the_joints_limits_are_found_within_half_a_degree() {
    let mut random = Random(17);
    let skeleton = skeleton();
    for side in [Side::Left, Side::Right] {
        let fit = HandFit::new(&skeleton, side);
        for trial in 0..500 {
            let fingers = random_fingers(&mut random, side);
            let (hand, turn) = landmarks(&mut random, side, &fingers, 0.0);
            let pose = fit.fit(&hand);
            if end_on(&hand.metres.map(|p| p.as_dvec3())) < 1.0 {
                // Its own fingers are hidden behind it.
                continue;
            }
            assert_eq!(pose.confidence, 1.0, "a large, certain hand");
            let palm = pose.camera_from_palm.expect("a palm");
            let error = degrees_between(turn, palm);
            assert!(error < 0.1, "{side:?} {trial}: the palm is off by {error}");
            for (k, truth) in fingers.iter().flatten().enumerate() {
                let error = degrees_between(*truth, pose.fingers[k]);
                assert!(error < 0.5, "{side:?} {trial}: joint {k} is off by {error}");
            }
        }
    }
}

#[test]
fn noise_of_two_millimetres_leaves_bones_within_fifteen_degrees_on_average() {
    let mut random = Random(5);
    let skeleton = skeleton();
    let fit = HandFit::new(&skeleton, Side::Right);
    let (mut sum, mut count) = (0.0, 0.0);
    for _ in 0..300 {
        let fingers = random_fingers(&mut random, Side::Right);
        let (hand, _) = landmarks(&mut random, Side::Right, &fingers, 0.002);
        let pose = fit.fit(&hand);
        for (finger, joints) in fingers.iter().enumerate() {
            let bone = (rest(Side::Right)[finger][2] - rest(Side::Right)[finger][1]).normalize();
            let (mut truth, mut got) = (DMat3::IDENTITY, DQuat::IDENTITY);
            for (k, joint) in joints.iter().enumerate() {
                truth *= *joint;
                got *= pose.fingers[3 * finger + k];
                sum += (truth * bone).angle_between(got * bone).to_degrees();
                count += 1.0;
            }
        }
    }
    let mean = sum / count;
    println!("2 mm of noise a coordinate: bones off by {mean:.1} degrees on average");
    assert!(mean < 15.0, "{mean} degrees");
}

#[test]
fn a_flat_hand_is_the_rest_pose_and_a_fist_closes_into_the_palm() {
    let mut random = Random(3);
    let skeleton = skeleton();
    for side in [Side::Left, Side::Right] {
        let fit = HandFit::new(&skeleton, side);
        let flat = [[DMat3::IDENTITY; 3]; 5];
        let pose = fit.fit(&landmarks(&mut random, side, &flat, 0.0).0);
        for (k, joint) in pose.fingers.iter().enumerate() {
            let angle = degrees_between(DMat3::IDENTITY, *joint);
            assert!(angle < 0.01, "{side:?} joint {k}: {angle}");
        }
        // Fingers in front of a palm that faces down go down when they flex.
        let mut fist = flat;
        for (finger, joints) in fist.iter_mut().enumerate().take(4) {
            let [curl, _] = axes(side, finger, 0);
            *joints = [70.0, 80.0, 50f64].map(|angle| about(curl, angle.to_radians()));
        }
        let pose = fit.fit(&landmarks(&mut random, side, &fist, 0.0).0);
        let tip = pose.fingers[3] * (mirror(side) * DVec3::X);
        assert!(tip.y < -0.8, "{side:?}: the middle finger points to {tip}");
    }
}

#[test]
fn a_small_or_doubtful_hand_relaxes_and_keeps_its_palm() {
    let mut random = Random(9);
    let fit = HandFit::new(&skeleton(), Side::Left);
    let fingers = random_fingers(&mut random, Side::Left);
    let (hand, turn) = loop {
        let (hand, turn) = landmarks(&mut random, Side::Left, &fingers, 0.0);
        if end_on(&hand.metres.map(|p| p.as_dvec3())) == 1.0 {
            break (hand, turn);
        }
    };
    let mut small = hand.clone();
    let first = small.pixels[0];
    let extent = small
        .pixels
        .iter()
        .fold(0.0f32, |most, p| most.max(p.distance(first)));
    small.pixels = small.pixels.map(|p| p * (8.0 / extent));
    let mut doubtful = hand.clone();
    doubtful.confidence = 0.1;
    let relaxed = [small, doubtful].map(|hand| fit.fit(&hand));
    for pose in relaxed {
        assert_eq!(pose.confidence, 0.0, "not believed");
        let palm = pose
            .camera_from_palm
            .expect("the palm is larger than a finger");
        assert!(degrees_between(turn, palm) < 0.1, "the palm");
        let curl = degrees_between(DMat3::IDENTITY, pose.fingers[0]);
        assert!((curl - 22.0).abs() < 0.1, "a relaxed knuckle, not {curl}");
    }
    let mut half = hand;
    half.confidence = 0.5;
    let pose = fit.fit(&half);
    assert!((pose.confidence - 0.5).abs() < 1e-6, "{}", pose.confidence);
}

#[test]
fn ten_thousand_broken_hands_give_finite_poses() {
    let mut random = Random(23);
    let fit = HandFit::new(&skeleton(), Side::Left);
    let odd = [
        f32::NAN,
        f32::INFINITY,
        f32::MAX,
        f32::MIN_POSITIVE,
        0.0,
        -1.0,
        1e-20,
    ];
    for trial in 0..10_000 {
        let broken = random.unit();
        let mut value = |scale: f64| {
            let pick = (random.unit() * 7.0) as usize;
            if random.unit() < broken {
                odd[pick]
            } else {
                random.within(-scale, scale) as f32
            }
        };
        let hand = HandLandmarks {
            pixels: std::array::from_fn(|_| Vec2::new(value(500.0), value(500.0))),
            metres: std::array::from_fn(|_| Vec3::new(value(0.1), value(0.1), value(0.1))),
            confidence: value(1.0),
        };
        let pose = fit.fit(&hand);
        assert!(
            (0.0..=1.0).contains(&pose.confidence),
            "{trial}: {}",
            pose.confidence
        );
        assert!(
            pose.camera_from_palm.is_none_or(DQuat::is_finite),
            "{trial}: palm"
        );
        for joint in pose.fingers {
            assert!((joint.length() - 1.0).abs() < 1e-6, "{trial}: {joint}");
        }
        if let Some(palm) = pose.camera_from_palm {
            let turn = fit.wrist(DQuat::from_xyzw(value(1.0).into(), 0.0, 0.1, 1.0), palm);
            assert!(
                turn.wrist.is_finite() && turn.elbow_share.is_finite(),
                "{trial}"
            );
        }
    }
    let nothing = Skeleton::new([Vec3::ZERO; JOINTS]).expect("in range");
    let mut random = Random(1);
    let (hand, _) = landmarks(&mut random, Side::Left, &[[DMat3::IDENTITY; 3]; 5], 0.0);
    let pose = HandFit::new(&nothing, Side::Left).fit(&hand);
    assert_eq!(pose.camera_from_palm, None, "an avatar without hands");
    assert!(
        pose.fingers.iter().all(|q| *q == DQuat::IDENTITY),
        "moves none"
    );
}

#[test]
fn the_forearms_twist_is_halved_and_the_rest_bends_the_wrist() {
    let mut random = Random(31);
    let fit = HandFit::new(&skeleton(), Side::Right);
    let [forearm, bend, sideways] = fit.wrist_axes;
    for _ in 0..200 {
        let camera_from_forearm = DQuat::from_mat3(&random.rotation());
        let twist = random.within(-1.6, 1.6);
        let bent = bend * random.within(-1.3, 1.3) + sideways * random.within(-0.5, 0.5);
        let turn = about(forearm, twist) * about(bent, bent.length());
        let palm = camera_from_forearm * DQuat::from_mat3(&turn);
        let found = fit.wrist(camera_from_forearm, palm);
        let error = degrees_between(turn, found.elbow_share * found.wrist);
        assert!(
            error < 0.01,
            "within limits the palm is where it was: {error}"
        );
        let half = degrees_between(about(forearm, twist / 2.0), found.elbow_share);
        assert!(half < 0.01, "half of it: {half}");
    }
    let backwards = DQuat::from_axis_angle(bend, 2.5);
    let found = fit.wrist(DQuat::IDENTITY, backwards);
    let angle = found.wrist.to_axis_angle().1.to_degrees();
    assert!((angle - 80.0).abs() < 0.01, "no wrist bends by {angle}");
}

/// Mean error of each of the fingers' three joints on the recorded renders, degrees, and the correlation of the whole curl.
fn errors_on_renders(fit: &HandFit) -> ([f64; 3], f64) {
    let (mut sums, mut curls) = ([0.0; 3], Vec::new());
    let rows: Vec<Vec<f32>> = include_str!("seen.txt")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            line.split(' ')
                .map(|w| w.parse().expect("a number"))
                .collect()
        })
        .collect();
    for row in &rows {
        let (truth, points) = row.split_at(12);
        let at = |k: usize| &points[5 * k..5 * k + 5];
        let hand = HandLandmarks {
            pixels: std::array::from_fn(|k| Vec2::from_slice(at(k))),
            metres: std::array::from_fn(|k| Vec3::from_slice(&at(k)[2..]) / 10_000.0),
            confidence: 1.0,
        };
        // What a small hand's fingers would be relaxed to is no measurement.
        let hand = HandLandmarks {
            pixels: hand.pixels.map(|p| p * 10.0),
            ..hand
        };
        let pose = fit.fit(&hand);
        let (mut curl, mut true_curl) = (0.0, 0.0);
        for (k, truth) in truth.iter().enumerate() {
            let rotation = pose.fingers[k];
            let [axis, _] = axes(Side::Left, k / 3, 0);
            let flexion = 2.0 * rotation.xyz().dot(axis).atan2(rotation.w).to_degrees();
            sums[k % 3] += (flexion - f64::from(*truth)).abs();
            curl += flexion;
            true_curl += f64::from(*truth);
        }
        curls.push((curl, true_curl));
    }
    let count = rows.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| curls.iter().map(of).sum::<f64>() / count;
    let (a, b) = (mean(|c| c.0), mean(|c| c.1));
    let moment = |x: fn(&(f64, f64)) -> f64, mx: f64, y: fn(&(f64, f64)) -> f64, my: f64| {
        curls.iter().map(|c| (x(c) - mx) * (y(c) - my)).sum::<f64>()
    };
    let both = moment(|c| c.0, a, |c| c.1, b);
    let own = moment(|c| c.0, a, |c| c.0, a) * moment(|c| c.1, b, |c| c.1, b);
    (sums.map(|sum| sum / (4.0 * count)), both / own.sqrt())
}

#[test]
fn rendered_fingers_curl_with_the_true_ones_and_closer_without_the_networks_bias() {
    let plain = HandFit::new(&skeleton(), Side::Left);
    let (raw, raw_curl) = errors_on_renders(&plain);
    let (undone, curl) = errors_on_renders(&plain.with_bias(FlexionBias::MEDIAPIPE));
    println!(
        "on renders, knuckle, middle and last joint off by {raw:.1?} degrees, correlation of curl {raw_curl:.2}"
    );
    println!("without MediaPipe's bias                         {undone:.1?} degrees, {curl:.2}");
    assert!(undone[0] < 0.75 * raw[0], "{undone:?} against {raw:?}");
    assert!(curl > 0.85, "{curl}");
}

#[test]
fn a_palm_that_points_at_the_camera_shows_no_fingers() {
    let mut points = [DVec3::ZERO; HAND_LANDMARKS];
    for (toward, believed) in [(0.0, 1.0), (0.95, 0.0)] {
        let along = f64::sqrt(1.0 - toward * toward);
        points[ROOTS[1]] = DVec3::new(0.0, -along, -toward) * 0.09;
        assert_eq!(
            end_on(&points),
            believed,
            "{toward} of it along the line of sight"
        );
    }
}
