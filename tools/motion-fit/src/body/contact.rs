//! Soles on the floor: when a heel or a ball of a foot stands still, and where.

use nalgebra::{Vector2, Vector3};

/// Pictures that a speed is measured over before a sole is taken to stand, and before it is let go: a late pin slides a little, one that
/// holds a lifting heel drags the whole body.
const WINDOW: usize = 5;
const SHORT: usize = 3;
/// A sole slower than this may be standing, one faster than the other is not, m/s across the line of sight. It is measured in the picture
/// alone: what stands before a camera that stands has the same pixel, and depth, whose noise is most of a speed in the room, says nothing
/// of it.
const STILL: f64 = 0.40;
const MOVING: f64 = 0.50;
/// A sole lower than this may be standing, one higher than the other is not, metres above the floor.
const LOW: f64 = 0.09;
const HIGH: f64 = 0.14;
/// A pin this far from where its sole is seen lets go, metres across the line of sight.
const TORN: f64 = 0.12;
/// Time for a pin to take hold and to let go, seconds.
const HOLD: f64 = 0.05;
/// A pin is the mean of where its sole was seen since it stands, for at most so long, seconds: what one picture says of its depth is wrong by
/// centimetres, and a wrong pin would turn the pelvis.
const MEAN: f64 = 6.0;
/// How long the place that is expected of the sole counts in that mean, seconds.
const EXPECTED: f64 = 0.5;
/// How fast a pin comes to the floor's height, 1/s: that is an estimate, too.
const SINK: f64 = 3.0;

/// A sole in one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SeenSole {
    /// In the world, metres.
    pub(super) place: Vector3<f64>,
    pub(super) pixel: Vector2<f64>,
    /// Metres across the line of sight in a pixel where the sole is.
    pub(super) metres_per_pixel: f64,
}

/// One heel or ball.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Contact {
    /// Where the sole appeared, pixels.
    history: [(f64, Vector2<f64>); WINDOW],
    count: usize,
    pin: Option<Vector3<f64>>,
    /// For how long it stands, seconds.
    standing: f64,
    /// How firmly the pin holds, 0..=1.
    hold: f64,
}

impl Contact {
    /// The point that the sole stands on, in the world, and how firmly, 0..=1.
    pub(super) fn pin(&self) -> Option<(Vector3<f64>, f64)> {
        self.pin.map(|pin| (pin, self.hold))
    }

    /// Whether the sole stands.
    pub(super) fn stands(&self) -> bool {
        self.pin.is_some() && self.hold > 0.3
    }

    /// One picture: the sole as it is seen, where the last fit's motion has it, the height of the lowest sole or the floor, whichever is
    /// higher, and the floor's.
    pub(super) fn update(
        &mut self,
        seconds: f64,
        step: f64,
        seen: Option<SeenSole>,
        expected: Vector3<f64>,
        lowest: f64,
        floor: f64,
    ) {
        let standing = match seen {
            Some(seen) => {
                if self.count == WINDOW {
                    self.history.rotate_left(1);
                    self.history[WINDOW - 1] = (seconds, seen.pixel);
                } else {
                    self.history[self.count] = (seconds, seen.pixel);
                    self.count += 1;
                }
                let torn = self
                    .pin
                    .is_some_and(|pin| (pin - seen.place).xy().norm() > TORN);
                let height = seen.place.y - lowest;
                let (window, slow, low) = if self.pin.is_some() {
                    (SHORT, MOVING, HIGH)
                } else {
                    (WINDOW, STILL, LOW)
                };
                !torn
                    && height < low
                    && (self.speed(window))
                        .is_some_and(|speed| speed * seen.metres_per_pixel < slow)
            }
            None => {
                self.count = 0;
                false
            }
        };
        let change = step / HOLD;
        if standing {
            self.hold = (self.hold + change).min(1.0);
            let mut pin = self.pin.unwrap_or(expected);
            if let Some(seen) = seen {
                self.standing = (self.standing + step).min(MEAN);
                let follow = step / (EXPECTED + self.standing);
                pin.x += (seen.place.x - pin.x) * follow;
                pin.z += (seen.place.z - pin.z) * follow;
            }
            pin.y += (floor - pin.y) * (SINK * step).min(1.0);
            self.pin = Some(pin);
        } else {
            self.hold -= change;
            if self.hold <= 0.0 {
                *self = Self {
                    history: self.history,
                    count: self.count,
                    ..Self::default()
                };
            }
        }
    }

    /// The pin turned about the world's origin.
    pub(super) fn turn(&mut self, by: &nalgebra::Matrix3<f64>) {
        if let Some(pin) = &mut self.pin {
            *pin = by * *pin;
        }
    }

    /// Speed over the newest `window` pictures by the line of least squares, pixels a second; `None` before there are as many.
    fn speed(&self, window: usize) -> Option<f64> {
        let newest = self
            .history
            .get(self.count.checked_sub(window)?..self.count)?;
        let n = newest.len() as f64;
        let middle = newest.iter().map(|(t, _)| t).sum::<f64>() / n;
        let mut above = Vector2::zeros();
        let mut below = 0.0;
        for (t, at) in newest {
            above += at * (t - middle);
            below += (t - middle) * (t - middle);
        }
        (below > 1e-9).then(|| (above / below).norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pictures of a sole at `place` whose pixel is `pixel`, 2 mm to a pixel, 30 a second.
    fn after(pictures: usize, at: impl Fn(f64) -> (Vector3<f64>, Vector2<f64>)) -> Contact {
        let mut contact = Contact::default();
        for k in 0..pictures {
            let seconds = k as f64 / 30.0;
            let (place, pixel) = at(seconds);
            let seen = SeenSole {
                place,
                pixel,
                metres_per_pixel: 0.002,
            };
            contact.update(seconds, 1.0 / 30.0, Some(seen), place, 0.0, 0.0);
        }
        contact
    }

    #[test]
    fn a_sole_whose_pixel_rests_stands_whatever_its_depth_seems() {
        let pixel = Vector2::new(300.0, 800.0);
        let contact = after(8, |t| {
            (Vector3::new(0.0, 0.02, 0.2 * (60.0 * t).sin()), pixel)
        });
        assert!(contact.stands(), "{contact:?}");
    }

    #[test]
    fn a_foot_that_swings_towards_the_camera_does_not_stand() {
        // Neither aside nor up in the room, but down in the picture: 2.6 m/s seen from 20 degrees above.
        let contact = after(8, |t| {
            let place = Vector3::new(0.0, 0.05, 2.6 * t);
            (place, Vector2::new(300.0, 500.0 + 445.0 * t))
        });
        assert!(!contact.stands(), "{contact:?}");
    }

    #[test]
    fn a_sole_stands_after_five_pictures_and_a_lifted_one_no_longer() {
        let still = Vector2::new(300.0, 800.0);
        let low = Vector3::new(0.0, 0.02, 0.0);
        assert!(!after(4, |_| (low, still)).stands(), "too early");
        assert!(after(5, |_| (low, still)).stands(), "late");
        let lifted = after(12, |t| {
            let up = 1.5 * (t - 0.2).max(0.0);
            (low + Vector3::y() * up, still - Vector2::y() * (up / 0.002))
        });
        assert!(!lifted.stands(), "{lifted:?}");
    }
}
