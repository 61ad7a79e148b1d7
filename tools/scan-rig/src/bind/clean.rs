//! Which Gaussians of a scan are left out: what shows nowhere as the scan stands, but would once the person moves.

use crate::scan::Scan;

/// A Gaussian that never has a larger blending weight shows nowhere.
const HIDDEN: f32 = 0.015;
/// A Gaussian farther from the surface is no part of the person, metres.
const APART: f32 = 0.06;
/// How far behind the surface a Gaussian may be, metres.
const BEHIND: f32 = -0.012;
/// How far from the surface a Gaussian that shows little may be, metres, and how much is little.
const OFF: (f32, f32) = (0.025, 0.1);
/// The same, for what shows less.
const FAINT: (f32, f32) = (0.008, 0.03);
/// How long a Gaussian that shows little may be, metres, and how much is little.
const COARSE: (f32, f32) = (0.04, 0.1);

/// Why a Gaussian is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unfit {
    /// It shows nowhere.
    Hidden,
    /// It is no part of the person.
    Apart,
    /// It is behind the surface.
    Behind,
    /// It is off the surface and shows little.
    Off,
    /// It is long and shows little.
    Coarse,
}

/// Where a Gaussian is relative to the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Distance to the nearest point of the surface, metres.
    pub(super) distance: f32,
    /// Of that, along the surface's normal: negative behind it, metres.
    pub(super) height: f32,
}

/// What is wrong with a Gaussian. `peak` is how much each shows. What is worn or carried is judged by less.
#[must_use]
pub(super) fn unfit(
    scan: &Scan,
    peak: &[f32],
    at: usize,
    place: Place,
    worn: bool,
) -> Option<Unfit> {
    let peak = peak[at];
    let less = |rule: (f32, f32)| place.distance > rule.0 && peak < rule.1;
    if peak.is_nan() || peak <= HIDDEN {
        return Some(Unfit::Hidden);
    }
    if place.distance.is_nan() || place.distance >= APART {
        return Some(Unfit::Apart);
    }
    if worn {
        return None;
    }
    if place.height < BEHIND {
        return Some(Unfit::Behind);
    }
    if less(OFF) || less(FAINT) {
        return Some(Unfit::Off);
    }
    let long = scan.scales[at].max_element() > COARSE.0;
    (long && peak < COARSE.1).then_some(Unfit::Coarse)
}
