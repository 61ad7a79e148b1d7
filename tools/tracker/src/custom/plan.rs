//! A description checked against its network and the part of a person that it is for.

use super::description::{Description, Frame, Number, Output, Representation, Trained};
use super::orders::{Order, Part};
use spmm3::{ExpressionBasis, Joint};

/// Weights of the longest expression.
const MOST_WEIGHTS: usize = 512;
/// First joints of the fingers, left and right.
const FINGERS: [Joint; 2] = [Joint::LeftIndex1, Joint::RightIndex1];
const WRISTS: [Joint; 2] = [Joint::LeftWrist, Joint::RightWrist];

/// Places of a face's joints.
pub(super) const HEAD: usize = 0;
pub(super) const JAW: usize = 1;
pub(super) const EYES: [usize; 2] = [2, 3];

impl Part {
    /// How many joints it has: of a body 22, of a hand the wrist and 15, of a face head, jaw and eyes. The first is the root, which
    /// stands in camera axes.
    pub(super) fn joints(self) -> usize {
        match self {
            Self::Body => 22,
            Self::Hand => 16,
            Self::Face => 4,
        }
    }

    /// The place of the parent of the joint at `place`.
    pub(super) fn parent(self, place: usize) -> Option<usize> {
        match self {
            _ if place == 0 => None,
            Self::Body => Some(Joint::ALL.get(place)?.parent()?.index()),
            Self::Hand if place % 3 == 1 => Some(0),
            Self::Hand => Some(place - 1),
            Self::Face => Some(HEAD),
        }
    }

    /// The place of the joint of that name; of a hand's only those of the sides that the network was trained on (of both: right).
    fn place(self, name: &str, trained: Trained) -> Option<usize> {
        let name = match name {
            "left_eye" | "right_eye" => &format!("{name}_smplhf"),
            _ => name,
        };
        let joint = Joint::ALL.into_iter().find(|joint| joint.name() == name)?;
        match self {
            Self::Body => Some(joint.index()).filter(|place| *place < self.joints()),
            Self::Hand => {
                let side = usize::from(trained != Trained::Left);
                if joint == WRISTS[side] {
                    return Some(0);
                }
                let place = joint.index().checked_sub(FINGERS[side].index())? + 1;
                (place < self.joints()).then_some(place)
            }
            Self::Face => [Joint::Head, Joint::Jaw, Joint::LeftEye, Joint::RightEye]
                .into_iter()
                .position(|own| own == joint),
        }
    }
}

/// How the outputs are read.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) part: Part,
    pub(super) description: Description,
    /// Of each output that holds rotations, the places of its joints.
    pub(super) places: Vec<Vec<usize>>,
    pub(super) basis: Option<ExpressionBasis>,
}

impl Plan {
    /// Checks `description`, whose outputs have so many numbers.
    pub(super) fn new(
        description: Description,
        part: Part,
        lengths: &[usize],
    ) -> Result<Self, String> {
        if part != Part::Hand && description.side != Trained::Both {
            return Err("only a hand's network has a side".to_owned());
        }
        let mut plan = Self {
            part,
            places: Vec::new(),
            basis: None,
            description,
        };
        let mut frames: Vec<Option<Frame>> = vec![None; part.joints()];
        for (output, length) in plan.description.outputs.iter().zip(lengths) {
            let places = plan.check(output, *length)?;
            let frame = match output {
                Output::Rotations { frame, .. } => *frame,
                _ => Frame::Parent,
            };
            for place in &places {
                let Some(slot) = frames.get_mut(*place) else {
                    continue;
                };
                if slot.replace(frame).is_some() {
                    return Err(format!("{} turns a joint twice", output.name()));
                }
            }
            plan.places.push(places);
            if let Output::Expression { basis, .. } = output {
                let basis = ExpressionBasis::new(basis.clone()).map_err(|why| why.to_string())?;
                plan.basis = Some(basis);
            }
        }
        check_frames(part, &frames)?;
        check_meanings(&plan.description.outputs)?;
        Ok(plan)
    }

    /// The places of the joints that `output` turns.
    fn check(&self, output: &Output, length: usize) -> Result<Vec<usize>, String> {
        let name = output.name();
        let need = |expected: usize, what: &str| {
            if length == expected {
                Ok(())
            } else {
                Err(format!(
                    "its output {name} has {length} numbers, but {what} makes {expected}"
                ))
            }
        };
        let landmarks = |order: &Order| {
            if order.part() == self.part {
                Ok(order.count())
            } else {
                let (its, part) = (order.part().name(), self.part.name());
                Err(format!(
                    "its output {name} has the order of a {its}, but this is a network for a {part}"
                ))
            }
        };
        let face = |what: &str| match self.part {
            Part::Face => Ok(()),
            part => Err(format!(
                "its output {name} is {what}, but this is a network for a {}",
                part.name()
            )),
        };
        match output {
            Output::Landmarks2d { order, numbers, .. } => {
                let count = landmarks(order)?;
                has_once(name, numbers, &[Number::X, Number::Y])?;
                need(
                    count * numbers.len(),
                    &format!("{count} landmarks of {}", numbers.len()),
                )?;
            }
            Output::Landmarks3d { order, numbers, .. } => {
                let count = landmarks(order)?;
                if self.part == Part::Face {
                    return Err(format!(
                        "its output {name}: a face's depth is the z of landmarks_2d"
                    ));
                }
                has_once(name, numbers, &[Number::X, Number::Y, Number::Z])?;
                need(
                    count * numbers.len(),
                    &format!("{count} landmarks of {}", numbers.len()),
                )?;
            }
            Output::SimccX {
                order,
                bins_per_pixel,
                ..
            }
            | Output::SimccY {
                order,
                bins_per_pixel,
                ..
            } => {
                let count = landmarks(order)?;
                let along = usize::from(matches!(output, Output::SimccY { .. }));
                if !(0.25..=16.0).contains(bins_per_pixel) {
                    return Err(format!("{name}: bins_per_pixel is 0.25..=16"));
                }
                #[allow(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "at most 2048 pixels of 16 bins"
                )]
                let bins = (self.description.input.sides()[along] as f32 * bins_per_pixel).round()
                    as usize;
                need(count * bins, &format!("{count} landmarks of {bins} bins"))?;
            }
            Output::Confidence { order: None, .. } => need(1, "a probability")?,
            Output::Confidence {
                order: Some(order), ..
            } => need(landmarks(order)?, "a probability for each landmark")?,
            Output::Rotations {
                joints,
                representation,
                ..
            } => {
                let places = joints.iter().map(|joint| self.joint(name, joint));
                let places = places.collect::<Result<_, _>>()?;
                self.need_rotations(joints.len(), *representation, &need)?;
                return Ok(places);
            }
            Output::Jaw { representation, .. } => {
                face("a jaw")?;
                self.need_rotations(1, *representation, &need)?;
                return Ok(vec![JAW]);
            }
            Output::Expression { .. } => {
                face("an expression")?;
                if length == 0 || length > MOST_WEIGHTS {
                    return Err(format!(
                        "its output {name} has {length} weights; 1..={MOST_WEIGHTS} are taken"
                    ));
                }
            }
            Output::Eyelids { .. } => {
                face("eyelids")?;
                need(2, "the left lid and the right one")?;
            }
        }
        Ok(Vec::new())
    }

    fn need_rotations(
        &self,
        joints: usize,
        representation: Representation,
        need: &impl Fn(usize, &str) -> Result<(), String>,
    ) -> Result<(), String> {
        let numbers = representation.numbers();
        need(
            joints * numbers,
            &format!("{joints} joints of {numbers} numbers"),
        )
    }

    fn joint(&self, output: &str, name: &str) -> Result<usize, String> {
        self.part.place(name, self.description.side).ok_or_else(|| {
            let side = match (self.part, self.description.side) {
                (Part::Hand, Trained::Left) => "left ",
                (Part::Hand, _) => "right ",
                _ => "",
            };
            format!(
                "its output {output} turns {name}, which is no joint of SMPL-X's {side}{}",
                self.part.name()
            )
        })
    }
}

fn has_once(name: &str, numbers: &[Number], needed: &[Number]) -> Result<(), String> {
    let count = |number: &Number| numbers.iter().filter(|n| *n == number).count();
    if needed.iter().all(|number| count(number) == 1) && count(&Number::Z) <= 1 {
        return Ok(());
    }
    Err(format!(
        "its output {name}: numbers must name each of {needed:?} once",
    ))
}

/// What outputs say together: each thing once, and the two halves of landmarks as bins of the same landmarks. That no joint is turned
/// twice is checked with the joints.
fn check_meanings(outputs: &[Output]) -> Result<(), String> {
    let (mut pixels, mut metres, mut down) = (None, None, None);
    let (mut overall, mut each, mut expression, mut eyelids) = (None, None, None, None);
    let mut along = None;
    for output in outputs {
        let (first, what) = match output {
            Output::Landmarks2d { .. } => (&mut pixels, "landmarks in the picture"),
            Output::SimccX { order, .. } => {
                along = Some(*order);
                (&mut pixels, "landmarks in the picture")
            }
            Output::SimccY { .. } => (&mut down, "simcc_y"),
            Output::Landmarks3d { .. } => (&mut metres, "landmarks in metres"),
            Output::Confidence { order: None, .. } => (&mut overall, "a confidence of the whole"),
            Output::Confidence { order: Some(_), .. } => (&mut each, "confidences of landmarks"),
            Output::Expression { .. } => (&mut expression, "an expression"),
            Output::Eyelids { .. } => (&mut eyelids, "eyelids"),
            Output::Rotations { .. } | Output::Jaw { .. } => continue,
        };
        if let Some(first) = first.replace(output) {
            return Err(format!(
                "its outputs {} and {} are both {what}: only one can be",
                first.name(),
                output.name()
            ));
        }
    }
    let across = match down {
        Some(Output::SimccY { order, .. }) => Some(*order),
        _ => None,
    };
    match (along, across) {
        (Some(along), Some(across)) if along != across => Err(
            "simcc_x and simcc_y have different orders, but they are the same landmarks".to_owned(),
        ),
        (Some(_), None) | (None, Some(_)) => Err("simcc_x and simcc_y go together".to_owned()),
        _ => Ok(()),
    }
}

/// The root stands in camera axes; any other joint in them needs its parent there, too.
fn check_frames(part: Part, frames: &[Option<Frame>]) -> Result<(), String> {
    let mut grounded = vec![false; frames.len()];
    for (place, frame) in frames.iter().enumerate() {
        let parent = part.parent(place);
        let stands = parent.is_some_and(|parent| grounded.get(parent) == Some(&true));
        let ok = match (frame, parent) {
            (None, _) => continue,
            (Some(frame), None) => *frame == Frame::Camera,
            (Some(Frame::Camera), Some(_)) => stands,
            (Some(Frame::Parent), Some(_)) => true,
        };
        if !ok {
            return Err(format!(
                "the root of a {} must be turned in camera axes (frame = \"camera\"), and other joints in camera axes need all joints \
                 between them and the root",
                part.name()
            ));
        }
        if let Some(grounded) = grounded.get_mut(place) {
            *grounded = stands || *frame == Some(Frame::Camera);
        }
    }
    Ok(())
}
