//! Scans of people who do not exist, whose joints are known: for tests and for `eval rig`.
//!
//! A body of MakeHuman that is none of the registered model's shapes (age and ancestry are not among them), clothes of uneven
//! thickness, a natural stance turned anyhow, small Gaussians with the noise of a training. It is of the same family as the model that is
//! registered to it, so it is easier than life.

mod balance;
mod cells;
mod person;
mod surroundings;

pub use person::{PEOPLE, Stance, SyntheticPerson};
pub use surroundings::Surroundings;

use crate::scan::Scan;
use glam::{DVec3, Quat, Vec3};
use spmm3::JOINTS;

/// How a scan is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanOptions {
    /// About how many Gaussians the person has.
    pub gaussians: usize,
    /// Standard deviation of the Gaussians' places, metres.
    pub noise: f32,
    /// What stands around the person.
    pub surroundings: Surroundings,
    /// What is wrong with the scan.
    pub fault: Option<Fault>,
    /// How long a metre is in the scan's own unit: trainers know no metres.
    pub unit: f32,
}

impl Default for ScanOptions {
    fn default() -> Self {
        Self {
            gaussians: 60_000,
            noise: 0.0015,
            surroundings: Surroundings::None,
            fault: None,
            unit: 1.0,
        }
    }
}

/// A scan of which no avatar can be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Nothing below the hips was scanned.
    HalfAPerson,
    /// Two people stand side by side.
    TwoPeople,
}

/// A scan and the truth about it, both in the scan's frame: its unit, y up, the floor at y = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct SyntheticScan {
    /// The Gaussians.
    pub scan: Scan,
    /// The triangle of the person's mesh that each Gaussian was made on; surroundings, which come last, have none.
    pub triangles: Vec<u32>,
    /// The joints' true places.
    pub joints: [DVec3; JOINTS],
    /// How far the person is turned to the left of +z, radians.
    pub yaw: f64,
    /// The person's height as it stands, metres.
    pub height: f64,
}

impl SyntheticPerson {
    /// The person's Gaussians in another pose, as a scan with these options (but for surroundings, faults and unit) would have them. Their
    /// colours hold the light of the stance.
    #[must_use]
    pub fn reposed(&self, options: &ScanOptions, pose: &Stance) -> Scan {
        let cells = self.cells(options.gaussians);
        self.splat(&cells, &self.posed(pose), options.noise)
    }

    /// A scan of this person in its stance; the same arguments give the same scan.
    #[must_use]
    pub fn scan(&self, options: &ScanOptions) -> SyntheticScan {
        let stance = self.stance();
        let vertices = self.posed(&stance);
        let cells = self.cells(options.gaussians);
        let mut scan = self.splat(&cells, &vertices, options.noise);
        let hips = stance.joints[0].y;
        match options.fault {
            Some(Fault::HalfAPerson) => {
                let keep: Vec<bool> = (scan.positions.iter())
                    .map(|p| f64::from(p.y) > hips)
                    .collect();
                scan = scan.filtered(&keep);
            }
            Some(Fault::TwoPeople) => {
                let mut other = scan.clone();
                other.transform(1.0, Quat::from_rotation_y(0.4), Vec3::new(0.9, 0.0, 0.1));
                scan.append(other);
            }
            None => {}
        }
        options.surroundings.add(&mut scan, self.seed());
        let height = (vertices.iter().map(|v| v.y)).fold(0.0, f64::max);
        scan.transform(options.unit, Quat::IDENTITY, Vec3::ZERO);
        SyntheticScan {
            scan,
            triangles: cells.iter().map(|cell| cell.triangle).collect(),
            joints: stance.joints.map(|j| j * f64::from(options.unit)),
            yaw: self.yaw(),
            height,
        }
    }
}
