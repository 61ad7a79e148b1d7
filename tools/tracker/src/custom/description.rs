//! The TOML that describes a network, as it is written.

use super::orders::Order;
use crate::TrackerError;
use serde::Deserialize;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The largest description, bytes.
const MOST_BYTES: u64 = 1 << 20;
/// Pixels along the largest input's side.
const MOST_PIXELS: usize = 2048;
/// The largest region, in sizes of what it is about.
const MOST_SCALE: f32 = 20.0;

/// What a description says.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Description {
    /// The network's file, relative to the description's folder.
    pub(super) network: Option<PathBuf>,
    /// Which hands a hand's network was trained on.
    #[serde(default)]
    pub(super) side: Trained,
    /// Below this probability nothing is seen.
    #[serde(default = "half")]
    pub(super) least_confidence: f32,
    pub(super) input: Input,
    #[serde(default)]
    pub(super) crop: CropRule,
    #[serde(rename = "output")]
    pub(super) outputs: Vec<Output>,
}

/// Whose hands a network knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Trained {
    /// Left ones; a right one is shown to it mirrored.
    Left,
    /// Right ones; a left one is shown to it mirrored.
    Right,
    /// Both, as they are.
    #[default]
    Both,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Input {
    pub(super) name: String,
    pub(super) size: Size,
    #[serde(default)]
    pub(super) layout: Layout,
    #[serde(default)]
    pub(super) colours: Colours,
    /// What black and white become.
    #[serde(default = "zero_to_one")]
    pub(super) range: [f32; 2],
    /// Subtracted after that, for each channel in the order of `colours`.
    #[serde(default)]
    pub(super) mean: [f32; 3],
    /// Divides after that.
    #[serde(default = "ones", rename = "std")]
    pub(super) deviation: [f32; 3],
}

/// Pixels of an input.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged)]
pub(super) enum Size {
    Square(usize),
    Sides([usize; 2]),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Layout {
    #[default]
    Nchw,
    Nhwc,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Colours {
    #[default]
    Rgb,
    Bgr,
}

/// Which square of the picture is looked at.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CropRule {
    /// The square's side, in sizes of the box about the landmarks.
    pub(super) scale: f32,
    pub(super) measure: Measure,
    /// The box is first widened or heightened to this width over height; by default the input's.
    pub(super) aspect: Option<f32>,
    /// Whether the square is turned with the body, hand or face.
    pub(super) turned: bool,
    pub(super) border: Beyond,
    /// What camera axes mean.
    pub(super) sight: Sight,
}

/// What the size of a box is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Measure {
    /// Its longer side.
    Longer,
    /// The mean of its sides.
    Mean,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Beyond {
    Black,
    Edge,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Sight {
    /// Camera axes look along the line of sight through the square's middle.
    Crop,
    /// They are those of the picture's camera.
    Picture,
}

impl Default for CropRule {
    fn default() -> Self {
        Self {
            scale: 1.5,
            measure: Measure::Longer,
            aspect: None,
            turned: false,
            border: Beyond::Black,
            sight: Sight::Crop,
        }
    }
}

/// One output that is used.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "meaning", deny_unknown_fields)]
pub(super) enum Output {
    #[serde(rename = "landmarks_2d")]
    Landmarks2d {
        name: String,
        order: Order,
        #[serde(default)]
        unit: PixelUnit,
        #[serde(default = "xy")]
        numbers: Vec<Number>,
    },
    #[serde(rename = "landmarks_3d")]
    Landmarks3d {
        name: String,
        order: Order,
        #[serde(default)]
        unit: MetricUnit,
        #[serde(default)]
        axes: Axes,
        #[serde(default = "xyz")]
        numbers: Vec<Number>,
    },
    #[serde(rename = "simcc_x")]
    SimccX {
        name: String,
        order: Order,
        #[serde(default = "two")]
        bins_per_pixel: f32,
    },
    #[serde(rename = "simcc_y")]
    SimccY {
        name: String,
        order: Order,
        #[serde(default = "two")]
        bins_per_pixel: f32,
    },
    #[serde(rename = "confidence")]
    Confidence {
        name: String,
        /// Whether it is to go through the logistic function.
        #[serde(default)]
        logit: bool,
        /// One number for each landmark, in this order; without it one number for all.
        order: Option<Order>,
    },
    #[serde(rename = "rotations")]
    Rotations {
        name: String,
        joints: Vec<String>,
        representation: Representation,
        frame: Frame,
        #[serde(default)]
        axes: Axes,
    },
    #[serde(rename = "jaw")]
    Jaw {
        name: String,
        #[serde(default)]
        representation: Representation,
    },
    #[serde(rename = "expression")]
    Expression { name: String, basis: String },
    #[serde(rename = "eyelids")]
    Eyelids { name: String },
}

impl Output {
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Landmarks2d { name, .. }
            | Self::Landmarks3d { name, .. }
            | Self::SimccX { name, .. }
            | Self::SimccY { name, .. }
            | Self::Confidence { name, .. }
            | Self::Rotations { name, .. }
            | Self::Jaw { name, .. }
            | Self::Expression { name, .. }
            | Self::Eyelids { name } => name,
        }
    }
}

/// What pixels are counted in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub(super) enum PixelUnit {
    /// Pixels of the input.
    #[default]
    #[serde(rename = "pixels")]
    Pixels,
    /// From the input's left and top to its right and bottom.
    #[serde(rename = "0..1")]
    ZeroToOne,
    /// The same from -1.
    #[serde(rename = "-1..1")]
    Centred,
    /// The same from -0.5.
    #[serde(rename = "-0.5..0.5")]
    Halves,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum MetricUnit {
    #[default]
    Metres,
    Millimetres,
}

/// What each landmark's numbers are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Number {
    X,
    Y,
    Z,
    Confidence,
    /// A probability before the logistic function.
    Logit,
    Unused,
}

/// Axes of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Axes {
    /// x right, y down, z away.
    #[default]
    YDown,
    /// x right, y up, z towards the camera.
    YUp,
}

/// How a rotation is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub(super) enum Representation {
    /// Three numbers: the axis times the angle.
    #[default]
    #[serde(rename = "axis-angle")]
    AxisAngle,
    /// The matrix' first column, then its second.
    #[serde(rename = "6d")]
    SixD,
    /// The matrix' first two columns, row after row.
    #[serde(rename = "6d-interleaved")]
    SixDInterleaved,
    /// The matrix' first row, then its second.
    #[serde(rename = "6d-rows")]
    SixDRows,
    /// Nine numbers, row after row.
    #[serde(rename = "matrix")]
    Matrix,
}

impl Representation {
    /// How many numbers a rotation has.
    pub(super) fn numbers(self) -> usize {
        match self {
            Self::AxisAngle => 3,
            Self::SixD | Self::SixDInterleaved | Self::SixDRows => 6,
            Self::Matrix => 9,
        }
    }
}

/// What a rotation turns from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Frame {
    Parent,
    Camera,
}

fn half() -> f32 {
    0.5
}

fn two() -> f32 {
    2.0
}

fn zero_to_one() -> [f32; 2] {
    [0.0, 1.0]
}

fn ones() -> [f32; 3] {
    [1.0; 3]
}

fn xy() -> Vec<Number> {
    vec![Number::X, Number::Y]
}

fn xyz() -> Vec<Number> {
    vec![Number::X, Number::Y, Number::Z]
}

impl Input {
    /// Width and height, pixels.
    pub(super) fn sides(&self) -> [usize; 2] {
        match self.size {
            Size::Square(side) => [side; 2],
            Size::Sides(sides) => sides,
        }
    }
}

impl Description {
    /// Reads the description at `path`, or the one beside the network at `path`; tells the description's and the network's file.
    pub(super) fn read(path: &Path) -> Result<(Self, PathBuf, PathBuf), TrackerError> {
        let is_toml = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        let toml = if is_toml {
            path.to_path_buf()
        } else {
            path.with_extension("toml")
        };
        let refuse = |reason: String| TrackerError::Description {
            path: toml.clone(),
            reason,
        };
        let text = read_text(&toml).map_err(|why| refuse(format!("cannot read it: {why}")))?;
        let description: Self = toml::from_str(&text).map_err(|why| refuse(why.to_string()))?;
        description.check().map_err(refuse)?;
        let onnx = match (&description.network, is_toml) {
            (_, false) => path.to_path_buf(),
            (Some(name), true) => toml.parent().unwrap_or(Path::new("")).join(name),
            (None, true) => toml.with_extension("onnx"),
        };
        Ok((description, toml, onnx))
    }

    fn check(&self) -> Result<(), String> {
        let input = &self.input;
        let sides = input.sides();
        if sides.iter().any(|side| !(8..=MOST_PIXELS).contains(side)) {
            return Err(format!(
                "an input of {sides:?} pixels; each side has 8..={MOST_PIXELS}"
            ));
        }
        let numbers = input
            .range
            .iter()
            .chain(&input.mean)
            .chain(&input.deviation);
        if numbers.clone().any(|n| !n.is_finite()) || input.deviation.contains(&0.0) {
            return Err("range, mean and std must be finite, and no std 0".to_owned());
        }
        let scale = self.crop.scale;
        if !(0.1..=MOST_SCALE).contains(&scale) {
            return Err(format!(
                "a crop's scale of {scale}; it is 0.1..={MOST_SCALE}"
            ));
        }
        let aspect = self.crop.aspect.unwrap_or(1.0);
        if !(0.1..=10.0).contains(&aspect) {
            return Err(format!("a crop's aspect of {aspect}; it is 0.1..=10"));
        }
        if !(0.0..=1.0).contains(&self.least_confidence) {
            return Err(format!(
                "least_confidence = {}; it is 0..=1",
                self.least_confidence
            ));
        }
        if self.outputs.is_empty() {
            return Err("it names no output".to_owned());
        }
        for (at, output) in self.outputs.iter().enumerate() {
            let name = output.name();
            if self
                .outputs
                .iter()
                .take(at)
                .any(|other| other.name() == name)
            {
                return Err(format!("it names the output {name} twice"));
            }
        }
        Ok(())
    }
}

fn read_text(path: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    std::fs::File::open(path)?
        .take(MOST_BYTES)
        .read_to_string(&mut text)?;
    Ok(text)
}
