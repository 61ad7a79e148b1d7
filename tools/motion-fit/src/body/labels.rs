//! Which cameras' networks have left and right exchanged: a network that mistakes them is as sure as ever, so cameras are compared with one another.

use super::reading::Exchange;
use super::terms::View;
use super::triangulate::{LocatedBody, locate, pixel, sigmas, triangulate};
use crate::landmarks::blazepose::{
    ANKLES, EARS, HEELS, HIPS, KNEES, LOWER, NOSE, SHOULDERS, TOES, mirrored,
};
use crate::landmarks::{BODY_LANDMARKS, BodyLandmarks};
use nalgebra::{Vector2, Vector3};

/// Left and right are exchanged where that brings landmarks nearer by this share, and they were off by more than so many standard deviations.
const CLEARLY: f64 = 0.6;
const OFF: f64 = 1.0;
/// So many cameras at most are tried in every labelling when nothing is expected yet: each one doubles what there is to try.
const MOST_TRIED: usize = 6;
/// Rounds in which labels and places settle.
const ROUNDS: usize = 4;
/// A head or feet that point so far away from where left and right say is ahead have these exchanged: the cosine of the angle. What tells that is
/// located with such a confidence, and so far apart, metres.
const BACKWARDS: f64 = -0.5;
const TRUSTED: f64 = 0.3;
const SHORTEST: f64 = 0.05;

/// Which cameras have left and right exchanged. They are compared with where landmarks were a frame before, where that is known, and then with each other.
/// Otherwise every labelling is tried of those that see most, and the rest are compared with these.
pub(super) fn label(
    views: &[View],
    seen: &[Option<BodyLandmarks>],
    before: Option<&LocatedBody>,
) -> Vec<Exchange> {
    let mut exchanges = vec![Exchange::NONE; views.len()];
    if let Some(before) = before {
        relabel(views, seen, before, &mut exchanges);
    } else {
        let chosen = surest(views.len(), seen);
        exchanges = tried(views, seen, &chosen);
        if chosen.len() < seen.iter().take(views.len()).flatten().count() {
            let few: Vec<Option<BodyLandmarks>> = (seen.iter().enumerate())
                .map(|(k, seen)| seen.clone().filter(|_| chosen.contains(&k)))
                .collect();
            let located = locate(views, &few, &exchanges);
            relabel(views, seen, &located, &mut exchanges);
        }
    }
    for _ in 0..ROUNDS {
        let was = exchanges.clone();
        let located = locate(views, seen, &exchanges);
        relabel(views, seen, &located, &mut exchanges);
        if was == exchanges {
            break;
        }
    }
    // Of a labelling and its mirror image, which explain the pictures alike, the one that exchanges less: most cameras are right.
    let mirrored = if before.is_some() {
        // What came before is no witness where the person faces away from it: after a cut into a half turn every camera would be exchanged.
        let doubted = exchanged_in(seen, &exchanges, |share| share >= 0.5);
        if doubted == Exchange::NONE {
            return exchanges;
        }
        let backwards = backwards(&locate(views, seen, &exchanges));
        Exchange {
            upper: doubted.upper && backwards.upper,
            lower: doubted.lower && backwards.lower,
        }
    } else {
        exchanged_in(seen, &exchanges, |share| share > 0.5)
    };
    if mirrored == Exchange::NONE {
        return exchanges;
    }
    for exchange in &mut exchanges {
        exchange.upper ^= mirrored.upper;
        exchange.lower ^= mirrored.lower;
    }
    // A camera that sees left and right on one another was exchanged by nothing but that.
    let located = locate(views, seen, &exchanges);
    for exchange in &mut exchanges {
        exchange.upper &= !mirrored.upper;
        exchange.lower &= !mirrored.lower;
    }
    relabel(views, seen, &located, &mut exchanges);
    exchanges
}

/// The halves that are exchanged in such a share of the cameras that see the person.
fn exchanged_in(
    seen: &[Option<BodyLandmarks>],
    exchanges: &[Exchange],
    is_enough: impl Fn(f64) -> bool,
) -> Exchange {
    let cameras = seen.iter().take(exchanges.len()).flatten().count().max(1);
    let enough = |of: fn(&Exchange) -> bool| {
        let all = seen.iter().zip(exchanges);
        let count = all.filter(|(seen, exchange)| seen.is_some() && of(exchange));
        is_enough(count.count() as f64 / cameras as f64)
    };
    Exchange {
        upper: enough(|exchange| exchange.upper),
        lower: enough(|exchange| exchange.lower),
    }
}

/// The halves of which left and right contradict where the head looks and the feet point. Neither depends on which side is which: the nose lies before the
/// middle of the ears, the tips of the feet before the heels. A half of which too little is located is with the other one, if shoulders and hips
/// now have the same side.
fn backwards(located: &LocatedBody) -> Exchange {
    let at = |landmark: usize| {
        let located = located[landmark].filter(|located| located.confidence >= TRUSTED);
        located.map(|located| located.place)
    };
    let middle = |pair: [usize; 2]| Some((at(pair[0])? + at(pair[1])?) / 2.0);
    let across = |pair: [usize; 2]| Some(at(pair[0])? - at(pair[1])?);
    let between = |from: [usize; 2], to: [usize; 2]| Some(middle(to)? - middle(from)?);
    let is_backwards =
        |across: Option<Vector3<f64>>, up: Option<Vector3<f64>>, ahead: Option<Vector3<f64>>| {
            let (across, ahead) = (across?, ahead?);
            if across.norm().min(ahead.norm()) < SHORTEST {
                return None;
            }
            let forward = across.cross(&up?).try_normalize(1e-3)?;
            Some(forward.dot(&ahead.normalize()) < BACKWARDS)
        };
    let trunk = between(HIPS, SHOULDERS).or_else(|| between(SHOULDERS, EARS));
    let nose = middle(EARS).and_then(|ears| Some(at(NOSE)? - ears));
    let head = is_backwards(across(EARS), trunk, nose);
    // Shins, not the trunk: who kneels has the feet behind.
    let feet = is_backwards(across(HIPS), between(ANKLES, KNEES), between(HEELS, TOES));
    let shoulders_and_hips = across(SHOULDERS).zip(across(HIPS));
    let are_alike = shoulders_and_hips.is_some_and(|(a, b)| a.dot(&b) > 0.0);
    let of_other = |other: Option<bool>| are_alike && other.unwrap_or(false);
    Exchange {
        upper: head.unwrap_or_else(|| of_other(feet)),
        lower: feet.unwrap_or_else(|| of_other(head)),
    }
}

/// The cameras, [`MOST_TRIED`] at most, that are surest of what they see, in their order.
fn surest(cameras: usize, seen: &[Option<BodyLandmarks>]) -> Vec<usize> {
    let mut all: Vec<(f64, usize)> = (seen.iter().take(cameras).enumerate())
        .filter_map(|(camera, seen)| {
            let seen = Some(seen.as_ref()?);
            let sure = (0..BODY_LANDMARKS).map(|k| pixel(seen, k, Exchange::NONE).1);
            Some((sure.sum(), camera))
        })
        .collect();
    all.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    all.truncate(MOST_TRIED);
    let mut chosen: Vec<usize> = all.into_iter().map(|(_, camera)| camera).collect();
    chosen.sort_unstable();
    chosen
}

/// The labelling in which the `chosen` cameras agree best; of a labelling and its mirror image, the one that exchanges less.
fn tried(views: &[View], seen: &[Option<BodyLandmarks>], chosen: &[usize]) -> Vec<Exchange> {
    let mut best = vec![Exchange::NONE; views.len()];
    let tried_views: Vec<View> = chosen.iter().map(|k| views[*k]).collect();
    for upper in [true, false] {
        let mut least = f64::INFINITY;
        let mut likeliest = 0_u32;
        for mask in 0..1_u32 << chosen.len() {
            let exchange = |bit: usize| {
                let set = mask >> bit & 1 == 1;
                Exchange {
                    upper: upper && set,
                    lower: !upper && set,
                }
            };
            let range = if upper {
                0..LOWER
            } else {
                LOWER..BODY_LANDMARKS
            };
            let mut off = 0.0;
            for landmark in range.filter(|landmark| mirrored(*landmark) != *landmark) {
                let pixels: Vec<(Vector2<f64>, f64)> = (chosen.iter().enumerate())
                    .map(|(bit, camera)| pixel(seen[*camera].as_ref(), landmark, exchange(bit)))
                    .collect();
                let place = triangulate(&tried_views, &pixels).map(|located| located.place);
                for (view, (pixel, confidence)) in tried_views.iter().zip(&pixels) {
                    let squares = place.map_or(10.0, |place| {
                        sigmas(view, &(view.project(&place) - pixel)).powi(2)
                    });
                    off += confidence * squares.ln_1p();
                }
            }
            // An exchange must be worth something.
            let off = off * (1.0 + 0.02 * f64::from(mask.count_ones()));
            if off < least {
                (least, likeliest) = (off, mask);
            }
        }
        for (bit, camera) in chosen.iter().enumerate() {
            let set = likeliest >> bit & 1 == 1;
            if upper {
                best[*camera].upper = set;
            } else {
                best[*camera].lower = set;
            }
        }
    }
    best
}

/// Exchanges left and right of each camera's halves where that is clearly nearer to what is expected.
fn relabel(
    views: &[View],
    seen: &[Option<BodyLandmarks>],
    expected: &LocatedBody,
    exchanges: &mut [Exchange],
) {
    for ((view, seen), exchange) in views.iter().zip(seen).zip(exchanges) {
        let half = |range: std::ops::Range<usize>, now: bool| {
            let (mut own, mut other, mut weights) = (0.0, 0.0, 0.0);
            for landmark in range.filter(|landmark| mirrored(*landmark) != *landmark) {
                let Some(located) = &expected[landmark] else {
                    continue;
                };
                let at = view.project(&located.place);
                let off = |exchange| {
                    let (pixel, confidence) = pixel(seen.as_ref(), landmark, exchange);
                    (sigmas(view, &(at - pixel)).powi(2).ln_1p(), confidence)
                };
                let ((straight, a), (crossed, b)) = (off(Exchange::NONE), off(Exchange::BOTH));
                let weight = a.min(b) * located.confidence;
                own += weight * straight;
                other += weight * crossed;
                weights += weight;
            }
            if weights == 0.0 {
                return now;
            }
            let (own, other) = (own / weights, other / weights);
            let bad = OFF.ln_1p();
            if now {
                !(own < CLEARLY * other && other > bad)
            } else {
                other < CLEARLY * own && own > bad
            }
        };
        *exchange = Exchange {
            upper: half(0..LOWER, exchange.upper),
            lower: half(LOWER..BODY_LANDMARKS, exchange.lower),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::landmarks::BodyPoint;
    use nalgebra::Rotation3;

    /// Cameras in a ring about the person.
    fn views(count: usize) -> Vec<View> {
        (0..count)
            .map(|k| {
                let angle = 0.3 + std::f64::consts::TAU * k as f64 / count as f64;
                View {
                    camera_from_world: (Rotation3::from_axis_angle(&Vector3::x_axis(), 0.1)
                        * Rotation3::from_axis_angle(&Vector3::y_axis(), angle))
                    .into_inner(),
                    translation: Vector3::new(0.1, 0.2, 4.0),
                    focal: 900.0,
                    centre: Vector2::new(540.0, 960.0),
                }
            })
            .collect()
    }

    fn places() -> [Vector3<f64>; BODY_LANDMARKS] {
        std::array::from_fn(|k| {
            let side = match mirrored(k) {
                0 => 0.0,
                other if other > k => 0.2,
                _ => -0.2,
            };
            // The nose is as high as the ears.
            let pair = if k == NOSE {
                EARS[0]
            } else {
                k.min(mirrored(k))
            };
            let height = f64::from(u8::try_from(pair).expect("small")) * 0.05;
            // Nose and feet point ahead.
            let ahead = if [NOSE, TOES[0], TOES[1]].contains(&k) {
                0.15
            } else {
                0.0
            };
            Vector3::new(side, 1.6 - height, 0.1 * side + ahead)
        })
    }

    /// What the views see where some have left and right exchanged.
    fn seen(views: &[View], exchanges: &[Exchange]) -> Vec<Option<BodyLandmarks>> {
        seen_at(&places(), views, exchanges)
    }

    fn seen_at(
        places: &[Vector3<f64>; BODY_LANDMARKS],
        views: &[View],
        exchanges: &[Exchange],
    ) -> Vec<Option<BodyLandmarks>> {
        (views.iter().zip(exchanges))
            .map(|(view, exchange)| {
                let mut body = BodyLandmarks {
                    points: [BodyPoint::default(); BODY_LANDMARKS],
                };
                for (k, point) in body.points.iter_mut().enumerate() {
                    let exchanged = if k < LOWER {
                        exchange.upper
                    } else {
                        exchange.lower
                    };
                    let from = if exchanged { mirrored(k) } else { k };
                    let pixel = view.project(&places[from]);
                    #[expect(clippy::cast_possible_truncation, reason = "pixels are f32")]
                    let pixel = glam::Vec2::new(pixel.x as f32, pixel.y as f32);
                    (point.pixel, point.confidence) = (pixel, 0.9);
                }
                Some(body)
            })
            .collect()
    }

    /// Of so many cameras, those with these numbers have arms or legs exchanged.
    fn exchanged(cameras: usize, arms: &[usize], legs: &[usize]) -> Vec<Exchange> {
        (0..cameras)
            .map(|camera| Exchange {
                upper: arms.contains(&camera),
                lower: legs.contains(&camera),
            })
            .collect()
    }

    #[test]
    fn cameras_that_have_left_and_right_exchanged_are_told_from_the_others() {
        // Up to six cameras are tried in every labelling; of more, some are compared with those.
        for (cameras, arms, legs) in [
            (4, &[][..], &[1][..]),
            (6, &[0, 5], &[2, 3]),
            (7, &[0, 6], &[1, 2, 6]),
            (8, &[1, 4, 7], &[3, 4, 5]),
            (12, &[0, 3, 6, 9], &[8, 9, 10, 11]),
        ] {
            let views = views(cameras);
            let expected = exchanged(cameras, arms, legs);
            let seen = seen(&views, &expected);
            let exchanges = label(&views, &seen, None);
            assert_eq!(exchanges, expected, "of {cameras} cameras");
            let located = locate(&views, &seen, &exchanges);
            for (located, place) in located.iter().zip(&places()) {
                let off = (located.expect("seen by all").place - place).norm();
                assert!(off < 1e-4, "{off} m, by {cameras} cameras");
            }
        }
    }

    #[test]
    fn the_frame_before_tells_which_of_two_cameras_is_mistaken() {
        let views = views(7);
        let truth = locate(
            &views,
            &seen(&views, &exchanged(7, &[], &[])),
            &[Exchange::NONE; 7],
        );
        for wrong in [0, 1] {
            let expected = exchanged(2, &[wrong], &[]);
            let seen = seen(&views[..2], &expected);
            assert_eq!(label(&views[..2], &seen, Some(&truth)), expected);
        }
    }

    /// `places` with the halves that are named turned by half a turn on the spot.
    fn turned(halves: Exchange) -> [Vector3<f64>; BODY_LANDMARKS] {
        let about = Rotation3::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI);
        let places = places();
        std::array::from_fn(|k| {
            let is_turned = if k < LOWER {
                halves.upper
            } else {
                halves.lower
            };
            if is_turned {
                about * places[k]
            } else {
                places[k]
            }
        })
    }

    /// Where the person is who has not turned.
    fn before(views: &[View]) -> LocatedBody {
        let none = vec![Exchange::NONE; views.len()];
        locate(views, &seen(views, &none), &none)
    }

    fn hide(bodies: &mut [Option<BodyLandmarks>], landmarks: &[usize]) {
        for body in bodies.iter_mut().flatten() {
            for k in landmarks {
                body.points[*k].confidence = 0.0;
            }
        }
    }

    #[test]
    fn a_cut_into_a_half_turn_on_the_spot_exchanges_only_the_camera_that_is_mistaken() {
        for (cameras, arms, legs) in [
            (5, &[][..], &[][..]),
            (5, &[3], &[1]),
            (2, &[1], &[1]),
            (4, &[0, 2], &[]),
        ] {
            let views = views(cameras);
            let expected = exchanged(cameras, arms, legs);
            let mut seen = seen_at(&turned(Exchange::BOTH), &views, &expected);
            let before = before(&views);
            assert_eq!(label(&views, &seen, Some(&before)), expected);
            // Either of face and feet tells it alone.
            for hidden in [&[NOSE][..], &TOES] {
                let mut seen = seen.clone();
                hide(&mut seen, hidden);
                let found = label(&views, &seen, Some(&before));
                assert_eq!(found, expected, "without {hidden:?}");
            }
            // Without both, nothing contradicts what came before.
            hide(&mut seen, &[NOSE, TOES[0], TOES[1]]);
            let trusted = label(&views, &seen, Some(&before));
            let opposite = expected.iter().map(|exchange| Exchange {
                upper: !exchange.upper,
                lower: !exchange.lower,
            });
            assert_eq!(trusted, opposite.collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_person_who_has_not_turned_keeps_the_sides_though_most_cameras_are_mistaken() {
        let views = views(5);
        let expected = exchanged(5, &[0, 1, 3], &[1, 2, 4]);
        let seen = seen(&views, &expected);
        assert_eq!(label(&views, &seen, Some(&before(&views))), expected);
    }

    #[test]
    fn each_half_is_told_by_its_own_landmarks() {
        let views = views(5);
        let none = exchanged(5, &[], &[]);
        for upper in [true, false] {
            let half = Exchange {
                upper,
                lower: !upper,
            };
            let seen = seen_at(&turned(half), &views, &none);
            assert_eq!(label(&views, &seen, Some(&before(&views))), none);
        }
    }

    #[test]
    fn cameras_that_see_nobody_or_are_not_there_exchange_nothing() {
        let views = views(7);
        let mut bodies = seen(&views, &exchanged(7, &[3], &[]));
        for camera in [0, 2, 5] {
            bodies[camera] = None;
        }
        assert_eq!(label(&views, &bodies, None), exchanged(7, &[3], &[]));
        assert_eq!(label(&views, &bodies[..2], None), exchanged(7, &[], &[]));
        // Of five views three see the person, and one of these has left and right exchanged.
        let few = label(&views[..5], &bodies, None);
        assert_eq!(few, exchanged(5, &[3], &[]), "bodies without a view");
        assert_eq!(label(&[], &bodies, None), []);
    }
}
