//! The BVH text format: a tree of joints with offsets and channels, then one row of numbers a frame.
//!
//! This reads what the file says, in the file's own units and axes; `names` tells which joint is which part of a person, and
//! `retarget` applies the motion to another body. No count in the file decides an allocation.

use super::{MAX_FRAMES, MotionError, printable, range};
use glam::{Quat, Vec3};

/// More joints than any rig of a person has; it bounds a hostile file.
const MAX_JOINTS: usize = 2048;
/// Positions and rotations in any order, with room for the odd repeated axis.
const MAX_CHANNELS: usize = 12;

/// What one channel of a frame sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Channel {
    /// Replaces the offset's coordinate on this axis, or adds to it: see [`Bvh::positions_add`].
    Position(usize),
    /// Turns about this axis, degrees, after the channels before it.
    Rotation(usize),
    /// Read and ignored: bones of a person do not grow.
    Scale,
}

/// One joint of the tree.
#[derive(Debug, Clone)]
pub(super) struct BvhJoint {
    pub(super) name: String,
    /// Always before the joint itself.
    pub(super) parent: Option<usize>,
    /// From the parent, file units.
    pub(super) offset: Vec3,
    /// End Site's offset, when the joint has one.
    pub(super) end: Option<Vec3>,
    channels: Vec<Channel>,
    /// Where its channels begin in a frame's row.
    first: usize,
}

/// A whole file.
#[derive(Debug, Clone)]
pub(super) struct Bvh {
    pub(super) joints: Vec<BvhJoint>,
    pub(super) frame_seconds: f64,
    width: usize,
    values: Vec<f32>,
    /// Exporters disagree about position channels below the root: most write the whole offset, MakeHuman's files write
    /// what is to be added to it (zeros). The reading that leaves the first frame's bones nearer to their rest length is taken.
    positions_add: bool,
}

impl Bvh {
    /// Parses a BVH text.
    pub(super) fn parse(text: &str) -> Result<Self, MotionError> {
        let mut words = Words::new(text);
        words.expect("HIERARCHY")?;
        let (joints, width) = hierarchy(&mut words)?;
        words.expect("MOTION")?;
        words.expect("Frames:")?;
        let (line, claimed) = words.next("the number of frames")?;
        let claimed: u64 = claimed.parse().map_err(|_| {
            MotionError::bvh(
                line,
                format!("`{}` is no number of frames", clip_word(claimed)),
            )
        })?;
        if claimed == 0 {
            return Err(MotionError::bvh(line, "the clip has no frames"));
        }
        if claimed > MAX_FRAMES as u64 {
            return Err(MotionError::TooLarge {
                what: "the BVH's number of frames",
                size: claimed,
                limit: MAX_FRAMES as u64,
            });
        }
        words.expect("Frame")?;
        words.expect("Time:")?;
        let (line, word) = words.next("the frame time")?;
        let frame_seconds: f64 = word.parse().map_err(|_| {
            let word = clip_word(word);
            MotionError::bvh(
                line,
                format!("a frame time of `{word}` is no number of seconds"),
            )
        })?;
        let frames = usize::try_from(claimed).unwrap_or(usize::MAX);
        if let Some(fault) = range::time_fault(frame_seconds, frames) {
            return Err(MotionError::bvh(line, fault));
        }
        let mut values = Vec::new();
        let mut line = line;
        while let Some((at, word)) = words.peek() {
            line = at;
            values.push(parse_number(at, word, "a motion value")?);
            words.skip();
            if values.len() as u64 > claimed * width as u64 {
                return Err(MotionError::bvh(
                    at,
                    format!("more numbers than {claimed} frames of {width} channels hold"),
                ));
            }
        }
        if values.len() as u64 != claimed * width as u64 {
            return Err(MotionError::bvh(
                line,
                format!(
                    "the file ends after {} numbers where {claimed} frames of {width} channels need {}",
                    values.len(),
                    claimed * width as u64
                ),
            ));
        }
        let mut bvh = Self {
            joints,
            frame_seconds,
            width,
            values,
            positions_add: false,
        };
        bvh.positions_add = bvh.positions_look_added();
        Ok(bvh)
    }

    fn positions_look_added(&self) -> bool {
        let (mut if_added, mut if_whole) = (0.0, 0.0);
        for joint in self.joints.iter().filter(|j| j.parent.is_some()) {
            for (channel, value) in joint.channels.iter().zip(&self.values[joint.first..]) {
                if let Channel::Position(axis) = channel {
                    if_added += value.abs();
                    if_whole += (value - joint.offset[*axis]).abs();
                }
            }
        }
        if_added < if_whole
    }

    /// Number of frames, at least 1.
    pub(super) fn frames(&self) -> usize {
        self.values.len() / self.width
    }

    /// Translation and rotation of `joint` relative to its parent in `frame`, file units and axes.
    pub(super) fn local(&self, frame: usize, joint: usize) -> (Vec3, Quat) {
        let joint = &self.joints[joint];
        let row = &self.values[frame * self.width + joint.first..];
        let mut translation = joint.offset;
        let mut rotation = Quat::IDENTITY;
        for (channel, value) in joint.channels.iter().zip(row) {
            match channel {
                Channel::Position(axis) if self.positions_add && joint.parent.is_some() => {
                    translation[*axis] += *value;
                }
                Channel::Position(axis) => translation[*axis] = *value,
                Channel::Rotation(axis) => {
                    rotation *= Quat::from_axis_angle(Vec3::AXES[*axis], value.to_radians());
                }
                Channel::Scale => {}
            }
        }
        (translation, rotation.normalize())
    }

    /// Whether any position channel of the file ever changes: a clip without walks on the spot.
    pub(super) fn travels(&self) -> bool {
        self.joints.iter().any(|joint| {
            joint.channels.iter().enumerate().any(|(k, channel)| {
                let at = joint.first + k;
                matches!(channel, Channel::Position(_))
                    && self
                        .values
                        .chunks_exact(self.width)
                        .any(|row| row[at] != self.values[at])
            })
        })
    }
}

/// Reads the tree with a stack of open braces, so that a deep file cannot exhaust the call stack.
fn hierarchy(words: &mut Words<'_>) -> Result<(Vec<BvhJoint>, usize), MotionError> {
    let mut joints: Vec<BvhJoint> = Vec::new();
    let mut width = 0;
    let mut open: Vec<usize> = Vec::new();
    loop {
        let (line, word) = words.next("the hierarchy's next word")?;
        match (word, open.last().copied()) {
            ("ROOT", None) | ("JOINT", Some(_)) => {
                if joints.len() == MAX_JOINTS {
                    return Err(MotionError::bvh(
                        line,
                        format!("more than {MAX_JOINTS} joints"),
                    ));
                }
                let name = words.name(line)?;
                words.expect("{")?;
                joints.push(BvhJoint {
                    name,
                    parent: open.last().copied(),
                    offset: Vec3::ZERO,
                    end: None,
                    channels: Vec::new(),
                    first: width,
                });
                open.push(joints.len() - 1);
            }
            ("OFFSET", Some(joint)) => joints[joint].offset = words.vector("OFFSET")?,
            ("CHANNELS", Some(joint)) => {
                if !joints[joint].channels.is_empty() {
                    return Err(MotionError::bvh(line, "a second CHANNELS in one joint"));
                }
                joints[joint].channels = channels(words)?;
                joints[joint].first = width;
                width += joints[joint].channels.len();
            }
            ("End", Some(joint)) => {
                words.expect("Site")?;
                words.expect("{")?;
                words.expect("OFFSET")?;
                joints[joint].end = Some(words.vector("OFFSET")?);
                words.expect("}")?;
            }
            ("}", Some(_)) => {
                open.pop();
                if open.is_empty() {
                    break;
                }
            }
            _ => {
                return Err(MotionError::bvh(
                    line,
                    format!("`{}` does not belong here", clip_word(word)),
                ));
            }
        }
    }
    if let Some((line, "ROOT")) = words.peek() {
        return Err(MotionError::bvh(
            line,
            "a second ROOT: save each person in a file of their own",
        ));
    }
    if width == 0 {
        return Err(MotionError::bvh(
            words.line(),
            "no joint has a channel, so nothing can move",
        ));
    }
    Ok((joints, width))
}

fn channels(words: &mut Words<'_>) -> Result<Vec<Channel>, MotionError> {
    let (line, count) = words.next("a number of channels")?;
    let count = count
        .parse()
        .ok()
        .filter(|count| *count <= MAX_CHANNELS)
        .ok_or_else(|| {
            MotionError::bvh(
                line,
                format!(
                    "`{}` is no number of channels (0..={MAX_CHANNELS})",
                    clip_word(count)
                ),
            )
        })?;
    let mut channels = Vec::with_capacity(count);
    for _ in 0..count {
        let (line, word) = words.next("a channel")?;
        let lower = word.to_ascii_lowercase();
        let axis = lower.chars().next().and_then(|c| "xyz".find(c));
        let kind = lower.get(1..).unwrap_or_default();
        channels.push(match (axis, kind) {
            (Some(axis), "position") => Channel::Position(axis),
            (Some(axis), "rotation") => Channel::Rotation(axis),
            (Some(_), "scale") => Channel::Scale,
            _ => {
                return Err(MotionError::bvh(
                    line,
                    format!(
                        "`{}` is no channel; Xposition..Zposition and Xrotation..Zrotation are",
                        clip_word(word)
                    ),
                ));
            }
        });
    }
    Ok(channels)
}

fn parse_number(line: usize, word: &str, what: &str) -> Result<f32, MotionError> {
    word.parse()
        .ok()
        .filter(|v: &f32| v.is_finite() && v.abs() < 1e9)
        .ok_or_else(|| {
            MotionError::bvh(
                line,
                format!(
                    "`{}` is no finite number, {what} is needed",
                    clip_word(word)
                ),
            )
        })
}

/// A word short enough for a message.
fn clip_word(word: &str) -> String {
    printable(word).chars().take(40).collect()
}

/// The text's words with their line numbers.
struct Words<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    rest: &'a str,
    line: usize,
}

impl<'a> Words<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            lines: text
                .strip_prefix('\u{feff}')
                .unwrap_or(text)
                .lines()
                .enumerate(),
            rest: "",
            line: 1,
        }
    }

    fn line(&self) -> usize {
        self.line
    }

    /// The next word, left in place.
    fn peek(&mut self) -> Option<(usize, &'a str)> {
        loop {
            self.rest = self.rest.trim_start();
            if !self.rest.is_empty() {
                let end = self
                    .rest
                    .find(char::is_whitespace)
                    .unwrap_or(self.rest.len());
                return Some((self.line, &self.rest[..end]));
            }
            let (index, line) = self.lines.next()?;
            (self.line, self.rest) = (index + 1, line);
        }
    }

    fn skip(&mut self) {
        if let Some((_, word)) = self.peek() {
            self.rest = &self.rest[word.len()..];
        }
    }

    fn next(&mut self, what: &str) -> Result<(usize, &'a str), MotionError> {
        let found = self.peek().ok_or_else(|| {
            MotionError::bvh(self.line, format!("the file ends where {what} is needed"))
        })?;
        self.skip();
        Ok(found)
    }

    fn expect(&mut self, word: &str) -> Result<(), MotionError> {
        let (line, found) = self.next(&format!("`{word}`"))?;
        if found.eq_ignore_ascii_case(word) {
            Ok(())
        } else {
            Err(MotionError::bvh(
                line,
                format!("`{}` where `{word}` is needed", clip_word(found)),
            ))
        }
    }

    /// A joint's name: the rest of its line, because some exporters put blanks into names.
    fn name(&mut self, line: usize) -> Result<String, MotionError> {
        let name = self.rest.trim();
        let (name, brace) = match name.strip_suffix('{') {
            Some(name) => (name.trim_end(), "{"),
            None => (name, ""),
        };
        self.rest = brace;
        if name.is_empty() || name.len() > 200 {
            return Err(MotionError::bvh(
                line,
                "a joint needs a name of 1..=200 bytes on its line",
            ));
        }
        Ok(printable(name))
    }

    fn number(&mut self, what: &str) -> Result<f32, MotionError> {
        let (line, word) = self.next(what)?;
        parse_number(line, word, what)
    }

    fn vector(&mut self, what: &str) -> Result<Vec3, MotionError> {
        Ok(Vec3::new(
            self.number(what)?,
            self.number(what)?,
            self.number(what)?,
        ))
    }
}
