//! "A man who works": which of the MakeHuman Team's items the demo person is made of. Proxies by other authors are left
//! out on purpose, because only the core assets were released under CC0.

use super::Part;
use crate::makehuman::{Macros, ScaleReference};

/// One proxy of the person.
pub(super) struct Item {
    /// JSON file below `public/data/proxies`.
    pub(super) model: &'static str,
    /// Texture below `public/data/proxies`.
    pub(super) texture: &'static str,
    /// The body it was made on.
    pub(super) made_on: ScaleReference,
    /// Which part it is; a garment of several pieces says which by the piece's count of vertices.
    pub(super) pieces: Pieces,
}

/// How an item's faces are labelled.
pub(super) enum Pieces {
    One(Part),
    /// Connected pieces, by their count of vertices in the file.
    ByCount(&'static [(usize, Part)]),
}

/// The body's skin, below `public/data`.
pub(super) const SKIN: &str =
    "skins/young_caucasian_male/textures/young_lightskinned_male_diffuse.png";

/// The body's shape.
pub(super) const MACROS: Macros = Macros {
    gender: 1.0,
    age: 0.5,
    muscle: 0.6,
    weight: 0.47,
    height: 0.5,
    proportions: 0.8,
    races: [0.0, 0.0, 1.0],
};

/// Where the 34 linear expression units lie.
pub(super) const UNITS: &str = "expression/units/caucasian/";

/// Expression units that are part of the neutral face: a friendlier one than the macros give.
pub(super) const NEUTRAL: [(&str, f32); 7] = [
    ("mouth-corner-puller", 0.2),
    ("eyebrows-left-down", -0.1),
    ("eyebrows-right-down", -0.1),
    ("eyebrows-left-extern-up", 0.3),
    ("eyebrows-right-extern-up", 0.3),
    ("eye-left-opened-up", NEUTRAL_EYES),
    ("eye-right-opened-up", NEUTRAL_EYES),
];

/// How wide the neutral face opens its eyes; a blink takes it back.
pub(super) const NEUTRAL_EYES: f32 = 0.15;

pub(super) const ITEMS: [Item; 8] = [
    Item {
        model: "clothes/male_casualsuit05/male_casualsuit05.json",
        texture: "clothes/male_casualsuit05/textures/male_casualsuit05_diffuse.png",
        made_on: ScaleReference::Male,
        pieces: Pieces::ByCount(&[
            (1659, Part::Jacket),
            (886, Part::Jeans),
            (373, Part::Shirt),
            // The lapels.
            (277, Part::Jacket),
        ]),
    },
    Item {
        model: "clothes/shoes04/shoes04.json",
        texture: "clothes/shoes04/textures/shoes04_diffuse.png",
        made_on: ScaleReference::Male,
        pieces: Pieces::One(Part::Shoes),
    },
    Item {
        model: "hair/short02/short02.json",
        texture: "hair/short02/textures/short02_diffuse.png",
        made_on: ScaleReference::Male,
        pieces: Pieces::One(Part::Hair),
    },
    Item {
        model: "eyes/HighPolyEyes/HighPolyEyes.json",
        texture: "eyes/HighPolyEyes/textures/blue_eye.png",
        made_on: ScaleReference::Male,
        pieces: Pieces::One(Part::Eyes),
    },
    Item {
        model: "eyebrows/eyebrow009/eyebrow009.json",
        texture: "eyebrows/eyebrow009/textures/eyebrow009.png",
        made_on: ScaleReference::Neutral,
        pieces: Pieces::One(Part::Brows),
    },
    Item {
        model: "eyelashes/Eyelashes01/Eyelashes01.json",
        texture: "eyelashes/Eyelashes01/textures/eyelashes01.png",
        made_on: ScaleReference::Base,
        pieces: Pieces::One(Part::Lashes),
    },
    Item {
        model: "teeth/Teeth_Base/Teeth_Base.json",
        texture: "teeth/Teeth_Base/textures/teeth.png",
        made_on: ScaleReference::Male,
        pieces: Pieces::One(Part::Teeth),
    },
    Item {
        model: "tongue/tongue01/tongue01.json",
        texture: "tongue/tongue01/textures/tongue01_diffuse.png",
        made_on: ScaleReference::Base,
        pieces: Pieces::One(Part::Tongue),
    },
];
