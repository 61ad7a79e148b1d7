//! Orders of landmarks, and where each stands in the order of the fit.

use motion_fit::landmarks::{BODY_LANDMARKS, FACE_LANDMARKS, HAND_LANDMARKS};
use serde::Deserialize;

/// What a network looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Body,
    Hand,
    Face,
}

impl Part {
    /// Landmarks that the fit knows.
    pub(super) fn landmarks(self) -> usize {
        match self {
            Self::Body => BODY_LANDMARKS,
            Self::Hand => HAND_LANDMARKS,
            Self::Face => FACE_LANDMARKS,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Body => "body",
            Self::Hand => "hand",
            Self::Face => "face",
        }
    }
}

/// An order that a network may give landmarks in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(super) enum Order {
    #[serde(rename = "blazepose-33")]
    BlazePose33,
    #[serde(rename = "coco-17")]
    Coco17,
    #[serde(rename = "halpe-26")]
    Halpe26,
    #[serde(rename = "coco-wholebody-133")]
    CocoWholeBody133,
    #[serde(rename = "mediapipe-hand-21", alias = "openpose-hand-21")]
    Hand21,
    #[serde(rename = "mediapipe-face-468")]
    Face468,
    #[serde(rename = "mediapipe-face-478")]
    Face478,
}

/// BlazePose's place of each of COCO's landmarks.
const COCO: [usize; 17] = [
    0, 2, 5, 7, 8, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28,
];
/// Of Halpe's after these: head's top, neck, hips' middle, big toes, small toes, heels.
const HALPE: [Option<usize>; 9] = [
    None,
    None,
    None,
    Some(31),
    Some(32),
    None,
    None,
    Some(29),
    Some(30),
];
/// Of COCO-WholeBody's after these: big toe, small toe and heel of each foot; then places of roots in the hands: index, little.
const WHOLE_BODY: [(usize, usize); 8] = [
    (17, 31),
    (19, 29),
    (20, 32),
    (22, 30),
    (91 + 5, 19),
    (91 + 17, 17),
    (112 + 5, 20),
    (112 + 17, 18),
];

impl Order {
    /// How many landmarks it has.
    pub(super) fn count(self) -> usize {
        match self {
            Self::BlazePose33 => BODY_LANDMARKS,
            Self::Coco17 => 17,
            Self::Halpe26 => 26,
            Self::CocoWholeBody133 => 133,
            Self::Hand21 => HAND_LANDMARKS,
            Self::Face468 => 468,
            Self::Face478 => FACE_LANDMARKS,
        }
    }

    /// What it is an order of.
    pub(super) fn part(self) -> Part {
        match self {
            Self::BlazePose33 | Self::Coco17 | Self::Halpe26 | Self::CocoWholeBody133 => Part::Body,
            Self::Hand21 => Part::Hand,
            Self::Face468 | Self::Face478 => Part::Face,
        }
    }

    /// Where landmark `at` stands in the fit's order.
    pub(super) fn target(self, at: usize) -> Option<usize> {
        match self {
            Self::Coco17 => COCO.get(at).copied(),
            Self::Halpe26 => COCO
                .get(at)
                .copied()
                .or_else(|| HALPE.get(at.checked_sub(COCO.len())?).copied().flatten()),
            Self::CocoWholeBody133 => COCO.get(at).copied().or_else(|| {
                let (_, target) = WHOLE_BODY.iter().find(|(from, _)| *from == at)?;
                Some(*target)
            }),
            Self::BlazePose33 | Self::Hand21 | Self::Face468 | Self::Face478 => {
                (at < self.count()).then_some(at)
            }
        }
    }
}
