//! Which joint of a BVH is which part of a person.
//!
//! Only limbs, hands, head and face go by name (the families CMU/MotionBuilder, Mixamo, MakeHuman old and new). Pelvis,
//! spine, neck and collars follow from the tree: they are what lies between the named parts, however many bones it is.

use super::{MotionError, bvh::BvhJoint};
use crate::Joint;
use std::collections::BTreeMap;

/// Left or right of the person.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Right,
}

/// Names without side, lower case, without separators, and the left joint they mean; the first match in a file wins.
const LIMBS: &[(Joint, &[&str])] = &[
    (
        Joint::LeftHip,
        &["upleg", "upperleg01", "upperleg", "thigh"],
    ),
    (
        Joint::LeftKnee,
        &["leg", "loleg", "lowerleg01", "lowerleg", "shin", "calf"],
    ),
    (Joint::LeftAnkle, &["foot"]),
    (Joint::LeftFoot, &["toebase", "toe", "toe21"]),
    (
        Joint::LeftShoulder,
        &["arm", "uparm", "upperarm01", "upperarm"],
    ),
    (
        Joint::LeftElbow,
        &["forearm", "loarm", "lowerarm01", "lowerarm"],
    ),
    // CMU's LeftHand is the ulna's turning third; its wrist is LeftFingerBase.
    (Joint::LeftWrist, &["fingerbase", "hand", "wrist"]),
    (Joint::LeftEye, &["eye"]),
    (Joint::LeftThumb1, &["handthumb1", "thumb1", "finger11"]),
    (Joint::LeftThumb2, &["handthumb2", "thumb2", "finger12"]),
    (Joint::LeftThumb3, &["handthumb3", "thumb3", "finger13"]),
    (Joint::LeftIndex1, &["handindex1", "index1", "finger21"]),
    (Joint::LeftIndex2, &["handindex2", "index2", "finger22"]),
    (Joint::LeftIndex3, &["handindex3", "index3", "finger23"]),
    (Joint::LeftMiddle1, &["handmiddle1", "middle1", "finger31"]),
    (Joint::LeftMiddle2, &["handmiddle2", "middle2", "finger32"]),
    (Joint::LeftMiddle3, &["handmiddle3", "middle3", "finger33"]),
    (Joint::LeftRing1, &["handring1", "ring1", "finger41"]),
    (Joint::LeftRing2, &["handring2", "ring2", "finger42"]),
    (Joint::LeftRing3, &["handring3", "ring3", "finger43"]),
    (Joint::LeftPinky1, &["handpinky1", "pinky1", "finger51"]),
    (Joint::LeftPinky2, &["handpinky2", "pinky2", "finger52"]),
    (Joint::LeftPinky3, &["handpinky3", "pinky3", "finger53"]),
];

/// Names without a side. MakeHuman's special04 is a child of the jaw and carries the chin and lower lip.
const MIDDLE: &[(Joint, &[&str])] = &[
    (Joint::Head, &["head"]),
    (Joint::Jaw, &["special04", "jaw"]),
];

/// The file's joints by part.
#[derive(Debug, Clone)]
pub(super) struct Parts {
    /// Named parts: index into the file's joints.
    named: BTreeMap<Joint, usize>,
    /// Lowest joint above both legs.
    pub(super) pelvis: usize,
    /// From the joint after the last common one of pelvis and chest, to the chest.
    pub(super) spine: Vec<usize>,
    /// Between chest and head.
    pub(super) neck: Vec<usize>,
    /// Left and right: the bone that carries the upper arm.
    pub(super) collars: [Option<usize>; 2],
    /// CMU's skeleton: a mitten of two bones stands for the hand, and its motion was not captured.
    pub(super) mitten_hands: bool,
    /// Names of joints that move nothing here.
    pub(super) unmapped: Vec<String>,
}

impl Parts {
    /// Finds the parts of a person among a file's joints.
    pub(super) fn find(joints: &[BvhJoint]) -> Result<Self, MotionError> {
        let mut named = BTreeMap::new();
        let mut by_name: BTreeMap<(Option<bool>, String), usize> = BTreeMap::new();
        for (index, joint) in joints.iter().enumerate() {
            if let Some((side, stem)) = stem(&joint.name) {
                by_name
                    .entry((side.map(|s| s == Side::Right), stem))
                    .or_insert(index);
            }
        }
        let look = |side: Option<bool>, stems: &[&str]| {
            stems
                .iter()
                .find_map(|stem| by_name.get(&(side, (*stem).to_owned())).copied())
        };
        let mitten_hands = look(Some(false), &["fingerbase"]).is_some();
        for (left, stems) in LIMBS {
            if mitten_hands && *left >= Joint::LeftIndex1 {
                continue;
            }
            for (joint, side) in [(*left, false), (mirrored(*left), true)] {
                if let Some(index) = look(Some(side), stems) {
                    named.insert(joint, index);
                }
            }
        }
        for (joint, stems) in MIDDLE {
            if let Some(index) = look(None, stems) {
                named.insert(*joint, index);
            }
        }
        let needed = [
            Joint::LeftHip,
            Joint::RightHip,
            Joint::LeftKnee,
            Joint::RightKnee,
            Joint::LeftAnkle,
            Joint::RightAnkle,
            Joint::Head,
        ];
        let missing: Vec<_> = needed
            .iter()
            .filter(|joint| !named.contains_key(joint))
            .map(|joint| joint.name())
            .collect();
        let tree = Tree(joints);
        let descends =
            |child: Joint, parent: Joint| tree.descends(named.get(&child)?, named.get(&parent)?);
        let limbs = [
            (Joint::LeftKnee, Joint::LeftHip),
            (Joint::LeftAnkle, Joint::LeftKnee),
            (Joint::LeftElbow, Joint::LeftShoulder),
            (Joint::LeftWrist, Joint::LeftElbow),
        ];
        let torn = limbs
            .iter()
            .flat_map(|(c, p)| [(*c, *p), (mirrored(*c), mirrored(*p))])
            .find(|(child, parent)| descends(*child, *parent) == Some(false));
        if !missing.is_empty() || torn.is_some() {
            let found: Vec<_> = joints.iter().take(12).map(|j| j.name.as_str()).collect();
            let torn = torn.map(|(c, p)| format!("{} below its {}", c.name(), p.name()));
            return Err(MotionError::Skeleton {
                missing: torn.unwrap_or_else(|| missing.join(", ")),
                found: found.join(", "),
            });
        }
        let pelvis = tree.common(named[&Joint::LeftHip], named[&Joint::RightHip]);
        let head = named[&Joint::Head];
        let chest = match (
            named.get(&Joint::LeftShoulder),
            named.get(&Joint::RightShoulder),
        ) {
            (Some(left), Some(right)) => tree.common(*left, *right),
            _ => joints[head].parent.unwrap_or(head),
        };
        let spine = tree.path(tree.common(pelvis, chest), chest);
        let neck: Vec<_> = {
            let mut path = tree.path(tree.common(chest, head), head);
            path.pop();
            path
        };
        let collar = |shoulder: Joint| {
            let parent = joints[*named.get(&shoulder)?].parent?;
            (parent != chest && tree.above(parent).any(|j| j == chest)).then_some(parent)
        };
        let collars = [collar(Joint::LeftShoulder), collar(Joint::RightShoulder)];
        let mut parts = Self {
            named,
            pelvis,
            spine,
            neck,
            collars,
            mitten_hands,
            unmapped: Vec::new(),
        };
        parts.unmapped = parts.list_unmapped(&tree);
        Ok(parts)
    }

    /// Where `joint` is in the file, for limbs, hands, head and face.
    pub(super) fn named(&self, joint: Joint) -> Option<usize> {
        self.named.get(&joint).copied()
    }

    /// A joint counts as used when it is a part or lies above one: its rotation then reaches the part.
    fn list_unmapped(&self, tree: &Tree<'_>) -> Vec<String> {
        let mut used = vec![false; tree.0.len()];
        for part in self.named.values().chain(&self.spine) {
            used[*part] = true;
            for above in tree.above(*part) {
                used[above] = true;
            }
        }
        tree.0
            .iter()
            .zip(used)
            .filter(|(_, used)| !used)
            .map(|(joint, _)| joint.name.clone())
            .collect()
    }
}

/// The joint on the person's other side; itself in the middle.
pub(super) fn mirrored(joint: Joint) -> Joint {
    let name = joint.name();
    let other = match name.split_once('_') {
        Some(("left", rest)) => format!("right_{rest}"),
        Some(("right", rest)) => format!("left_{rest}"),
        _ => return joint,
    };
    Joint::ALL
        .into_iter()
        .find(|j| j.name() == other)
        .unwrap_or(joint)
}

/// Side and bare stem of a joint's name; `None` for the helper joints (`__UpLeg_L`) that older MakeHuman puts between bones.
fn stem(name: &str) -> Option<(Option<Side>, String)> {
    let name = name.rsplit(':').next().unwrap_or(name);
    if name.starts_with("__") {
        return None;
    }
    let plain = |s: &str| {
        s.chars()
            .filter(|c| c.is_alphanumeric())
            .flat_map(char::to_lowercase)
            .collect()
    };
    let suffixes = [
        ("_L", Side::Left),
        (".L", Side::Left),
        ("_R", Side::Right),
        (".R", Side::Right),
        ("_l", Side::Left),
        (".l", Side::Left),
        ("_r", Side::Right),
        (".r", Side::Right),
    ];
    for (suffix, side) in suffixes {
        if let Some(rest) = name.strip_suffix(suffix) {
            return Some((Some(side), plain(rest)));
        }
    }
    let name = name.strip_prefix("mixamorig").unwrap_or(name);
    let name = name.trim_start_matches(|c: char| c.is_ascii_digit() || c == '_');
    for (prefix, side) in [("Left", Side::Left), ("Right", Side::Right)] {
        if let Some(rest) = name.strip_prefix(prefix) {
            return Some((Some(side), plain(rest)));
        }
    }
    for (prefix, side) in [('L', Side::Left), ('R', Side::Right)] {
        if let Some(rest) = name.strip_prefix(prefix)
            && rest.starts_with(|c: char| c.is_ascii_uppercase())
        {
            return Some((Some(side), plain(rest)));
        }
    }
    Some((None, plain(name)))
}

/// Paths through the tree.
struct Tree<'a>(&'a [BvhJoint]);

impl Tree<'_> {
    /// The joints above `joint`, nearest first.
    fn above(&self, joint: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(self.0[joint].parent, |j| self.0[*j].parent)
    }

    fn descends(&self, child: &usize, parent: &usize) -> Option<bool> {
        Some(self.above(*child).any(|j| j == *parent))
    }

    /// The lowest common ancestor of both (itself included).
    fn common(&self, a: usize, b: usize) -> usize {
        let of_a: Vec<_> = std::iter::once(a).chain(self.above(a)).collect();
        std::iter::once(b)
            .chain(self.above(b))
            .find(|j| of_a.contains(j))
            .unwrap_or(0)
    }

    /// The joints below `from` down to `to`, the nearest to `from` first.
    fn path(&self, from: usize, to: usize) -> Vec<usize> {
        let mut path: Vec<_> = std::iter::once(to)
            .chain(self.above(to))
            .take_while(|j| *j != from)
            .collect();
        path.reverse();
        path
    }
}

/// The names in few words: those that differ only in digits and side are counted together.
pub(super) fn summarise(names: &[String]) -> String {
    let mut stems: BTreeMap<String, usize> = BTreeMap::new();
    for name in names {
        let bare = name.strip_suffix(['L', 'R']);
        let bare = bare
            .and_then(|n| n.strip_suffix(['.', '_']))
            .unwrap_or(name)
            .trim_end_matches(|c: char| c.is_ascii_digit() || c == '-');
        *stems.entry(bare.to_owned()).or_default() += 1;
    }
    let mut words: Vec<_> = stems
        .into_iter()
        .map(|(stem, count)| match count {
            1 => stem,
            _ => format!("{stem} x{count}"),
        })
        .collect();
    let rest = words.len().saturating_sub(24);
    words.truncate(24);
    if rest > 0 {
        words.push(format!("and {rest} more"));
    }
    words.join(", ")
}
