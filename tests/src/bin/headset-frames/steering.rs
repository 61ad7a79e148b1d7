//! The commands to the running program, and its answers about cameras and hands.

use std::collections::VecDeque;
use std::io::stdin;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use glam::{Affine3A, Quat, Vec3};
use renderer_openxr::input::{Controls, Hand};
use renderer_openxr::wearer::Wearer;
use renderer_splat::camera::Camera;
use serde_json::{Value, json};

/// A command for the next frame that is shown.
#[derive(Debug)]
pub(crate) enum Command {
    /// `tell NAME`: print the poses of head, eyes and hands.
    Tell(String),
    /// `read NAME`: the same, and write both eyes' pictures to `NAME-left.png` and `NAME-right.png`.
    Read(String),
}

impl Command {
    fn parse(line: &str) -> Option<Self> {
        let (what, name) = line.split_once(' ')?;
        match what {
            "tell" => Some(Self::Tell(name.to_owned())),
            "read" => Some(Self::Read(name.to_owned())),
            _ => None,
        }
    }

    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Tell(name) | Self::Read(name) => name,
        }
    }
}

/// Commands, one for each frame; anything else, and the end of the input, ends the program.
pub(crate) struct Steering {
    commands: Receiver<Command>,
    waiting: VecDeque<Command>,
    over: bool,
}

impl Steering {
    /// Listens on the standard input.
    pub(crate) fn start() -> Self {
        let (give, commands) = channel();
        thread::spawn(move || {
            for line in stdin().lines() {
                let Some(command) = line.ok().as_deref().and_then(Command::parse) else {
                    break;
                };
                if give.send(command).is_err() {
                    break;
                }
            }
        });
        Self {
            commands,
            waiting: VecDeque::new(),
            over: false,
        }
    }

    /// Takes the commands that have arrived.
    pub(crate) fn listen(&mut self) {
        loop {
            match self.commands.try_recv() {
                Ok(command) => self.waiting.push_back(command),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {
                    self.over = true;
                    return;
                }
            }
        }
    }

    /// The next command, if there is one by now.
    pub(crate) fn next(&mut self) -> Option<Command> {
        self.waiting.pop_front()
    }

    /// Whether no more commands will come.
    pub(crate) fn is_over(&self) -> bool {
        self.over && self.waiting.is_empty()
    }
}

/// A camera as numbers: columns of its rotation, its translation (metres), focal lengths and centre (pixels).
pub(crate) fn camera_json(camera: &Camera) -> Value {
    let Affine3A {
        matrix3,
        translation,
    } = camera.camera_from_world;
    json!({
        "rotation": matrix3.to_cols_array(),
        "translation": Vec3::from(translation).to_array(),
        "focal": [camera.fx, camera.fy],
        "centre": [camera.cx, camera.cy],
        "size": [camera.width, camera.height],
    })
}

/// A pose as numbers.
fn pose_json(pose: Option<Affine3A>) -> Value {
    let pose = pose.map(|pose| {
        json!({
            "rotation": Quat::from_mat3a(&pose.matrix3).to_array(),
            "position": Vec3::from(pose.translation).to_array(),
        })
    });
    pose.unwrap_or_default()
}

/// Both hands as numbers.
pub(crate) fn controls_json(controls: &Controls) -> Value {
    let hand = |hand: Hand| {
        json!({
            "grip": pose_json(hand.floor_from_grip),
            "aim": pose_json(hand.floor_from_aim),
            "holds": hand.holds,
        })
    };
    json!(controls.hands.map(hand))
}

/// The wearer's head and hands as numbers.
pub(crate) fn wearer_json(wearer: &Wearer) -> Value {
    let hands = wearer.hands.iter().map(|hand| {
        let joints = hand.joints.map(|joints| joints.map(pose_json).to_vec());
        json!({ "joints": joints, "grip": pose_json(hand.floor_from_grip) })
    });
    json!({
        "seconds": wearer.seconds,
        "view": pose_json(wearer.floor_from_view),
        "hands": hands.collect::<Vec<_>>(),
    })
}
