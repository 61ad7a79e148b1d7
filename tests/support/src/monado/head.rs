//! A head, its eyes and its hands as Monado's `remote` driver takes them (`src/xrt/drivers/remote/r_interface.h` of 25.0.0).

use std::io::Write;
use std::net::{Ipv4Addr, TcpStream};
use std::thread::sleep;
use std::time::{Duration, Instant};

use glam::{Quat, Vec3};
use renderer_splat::camera::Fov;

use crate::service::{LONGEST_WAIT, assert_all_live};

/// A pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// A unit quaternion.
    pub rotation: Quat,
    /// Metres.
    pub position: Vec3,
}

impl Pose {
    /// Not turned.
    #[must_use]
    pub const fn at(x: f32, y: f32, z: f32) -> Self {
        Self {
            rotation: Quat::IDENTITY,
            position: Vec3::new(x, y, z),
        }
    }

    /// The same place, turned.
    #[must_use]
    pub const fn turned(self, rotation: Quat) -> Self {
        Self { rotation, ..self }
    }
}

/// An eye.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    /// What it sees.
    pub fov: Fov,
    /// From its space to the head's.
    pub head_from_eye: Pose,
}

/// A controller, and the hand simulated from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Controller {
    /// Whether it is present.
    pub active: bool,
    /// Whether the bare hand is seen.
    pub hand_tracking: bool,
    /// Of the grip and of the hand, in the stage, whose floor is at y = 0.
    pub stage_from_grip: Pose,
    /// Index finger's trigger, 0 to 1.
    pub trigger: f32,
    /// Squeeze, 0 to 1.
    pub squeeze: f32,
    /// The button of the runtime's own menu.
    pub system: bool,
    /// The upper button.
    pub b: bool,
    /// How far fingers are curled: little, ring, middle, index, thumb; 0 open to 1.
    pub curls: [f32; 5],
}

impl Controller {
    /// One that lies there.
    #[must_use]
    pub const fn at(stage_from_grip: Pose) -> Self {
        Self {
            active: true,
            hand_tracking: false,
            stage_from_grip,
            trigger: 0.0,
            squeeze: 0.0,
            system: false,
            b: false,
            curls: [0.0; 5],
        }
    }
}

/// One message to the driver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scripted {
    /// The middle of the head in the stage, whose floor is at y = 0.
    pub stage_from_head: Pose,
    /// Left, right.
    pub eyes: [Eye; 2],
    /// Left, right.
    pub controllers: [Controller; 2],
}

impl Default for Scripted {
    /// Standing upright at the stage's origin, 64 mm between the eyes, which see more outwards than inwards; hands before the body.
    fn default() -> Self {
        let eye = |side: f32, left, right| Eye {
            fov: Fov {
                left,
                right,
                up: 0.62,
                down: -0.74,
            },
            head_from_eye: Pose::at(0.032 * side, 0.0, 0.0),
        };
        Self {
            stage_from_head: Pose::at(0.0, 1.6, 0.0),
            eyes: [eye(-1.0, -0.8, 0.66), eye(1.0, -0.66, 0.8)],
            controllers: [-0.2, 0.2].map(|x| Controller::at(Pose::at(x, 1.3, -0.5))),
        }
    }
}

const BYTES: usize = 376;
const HEAD: usize = 8;
const CONTROLLERS: [usize; 2] = [136, 256];

impl Scripted {
    /// As it goes over the line.
    #[must_use]
    pub fn packet(&self) -> [u8; BYTES] {
        let mut packet = Packet([0; BYTES]);
        packet.put(0, b"mndrmt3\0");
        for (at, eye) in [HEAD, HEAD + 48].into_iter().zip(&self.eyes) {
            let Fov {
                left,
                right,
                up,
                down,
            } = eye.fov;
            packet.floats(at, &[left, right, up, down]);
            packet.pose(at + 16, &eye.head_from_eye);
        }
        packet.pose(HEAD + 96, &self.stage_from_head);
        // The eyes follow the message.
        packet.flag(HEAD + 124, true);
        for (at, hand) in CONTROLLERS.into_iter().zip(&self.controllers) {
            packet.pose(at, &hand.stage_from_grip);
            packet.floats(at + 52, &hand.curls);
            packet.floats(at + 72, &[hand.trigger, hand.squeeze]);
            packet.flag(at + 104, hand.hand_tracking);
            packet.flag(at + 105, hand.active);
            packet.flag(at + 106, hand.system);
            packet.flag(at + 110, hand.b);
            packet.flag(at + 112, hand.trigger > 0.9);
        }
        packet.0
    }
}

struct Packet([u8; BYTES]);

impl Packet {
    fn put(&mut self, at: usize, bytes: &[u8]) {
        self.0[at..at + bytes.len()].copy_from_slice(bytes);
    }

    fn floats(&mut self, at: usize, values: &[f32]) {
        for (index, value) in values.iter().enumerate() {
            self.put(at + 4 * index, &value.to_le_bytes());
        }
    }

    fn pose(&mut self, at: usize, pose: &Pose) {
        self.floats(at, &pose.rotation.to_array());
        self.floats(at + 16, &pose.position.to_array());
    }

    fn flag(&mut self, at: usize, set: bool) {
        self.put(at, &[u8::from(set)]);
    }
}

/// A connection to the driver. What was sent last stays in force after it is closed.
#[derive(Debug)]
pub struct Head {
    driver: TcpStream,
}

impl Head {
    pub(super) fn connect(port: u16) -> Self {
        let deadline = Instant::now() + LONGEST_WAIT;
        loop {
            match TcpStream::connect((Ipv4Addr::LOCALHOST, port)) {
                Ok(driver) => return Self { driver },
                Err(why) => assert!(Instant::now() < deadline, "the remote driver: {why}"),
            }
            assert_all_live();
            sleep(Duration::from_millis(20));
        }
    }

    /// Moves it. It is there at once by the service's measure, and for frames that a client waits for from then on.
    ///
    /// # Panics
    /// If the service is gone.
    pub fn send(&mut self, scripted: &Scripted) {
        self.driver
            .write_all(&scripted.packet())
            .unwrap_or_else(|why| panic!("the remote driver: {why}"));
    }
}
