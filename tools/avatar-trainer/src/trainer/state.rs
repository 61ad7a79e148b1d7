//! A training written down, and taken up again.

use super::Trainer;
use crate::checkpoint::{OLDEST, Reader, Stored, VERSION, Writer};
use crate::colour::NUMBERS;
use crate::error::TrainError;
use crate::options::Options;
use crate::pictures::Split;
use crate::source::Source;
use crate::trainer::begin::check_motions;
use crate::trainer::optimiser::BASES;
use crate::trainer::perceptual::Perceptual;
use avatar_gradient::{CORRECTION, Networks, Parameters, PoseCorrection, Sizes};
use capture::Capture;
use glam::Vec3;
use half::f16;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use splat_gradient::loss::PerceptualLoss;
use spmm3::networks::{AttributeNetwork, Dense, MeshNetwork, QuantisedBases, QuantisedDecoder};
use spmm3::package::{MAX_CONTROLLERS, MAX_GAUSSIANS};
use spmm3::{ATTRIBUTES, Avatar, BoundGaussians, Controllers, MotionParams, NEIGHBOURS, PARAMS};
use std::io::Cursor;
use std::path::Path;

/// More hidden units, fields or bases than any network of a package has.
const MOST_UNITS: usize = 4096;

/// More steps than a training makes in years.
const MOST_STEPS: u64 = 1 << 40;

/// What of the state is no array.
#[derive(Debug, Serialize, Deserialize)]
struct Text<N> {
    version: u32,
    /// A training goes on with its own capture.
    source: Source,
    options: Options,
    /// The identity of the perceptual loss; nothing of a training without one.
    #[serde(default)]
    perceptual: Option<String>,
    gaussians: usize,
    controller_hidden: usize,
    bases: usize,
    mesh_hidden: [usize; 2],
    rank: usize,
    had_attributes: bool,
    step: u64,
    unchanged: u32,
    rounds: u32,
    best: Option<f64>,
    /// What the caller keeps with it, e.g. the time that was used.
    note: N,
    /// Steps of each optimiser.
    array_steps: Vec<u32>,
    basis_steps: u32,
    pose_steps: Vec<u32>,
    colour_steps: Vec<u32>,
}

/// The numbers of all of one kind, one after the other.
fn flat<T>(all: &[T], of: impl Fn(&T) -> &[f32]) -> Vec<f32> {
    all.iter().flat_map(of).copied().collect()
}

impl<'a> Trainer<'a> {
    /// Writes all state to one file, complete or not at all. `note` is kept with it for the caller.
    ///
    /// # Errors
    /// A number that is not finite, a file that cannot be written; what was there before stays.
    pub fn save(&self, path: &Path, note: &impl Serialize) -> Result<(), TrainError> {
        let sizes = self.model.sizes();
        let steps = |adams: &mut dyn Iterator<Item = u32>| adams.collect::<Vec<u32>>();
        let text = Text {
            version: VERSION,
            source: Source::of(self.pictures.capture()),
            options: self.options.clone(),
            perceptual: (self.perceptual.as_ref()).map(|loss| loss.identity().to_owned()),
            gaussians: sizes.gaussians,
            controller_hidden: sizes.controller_hidden,
            bases: sizes.bases,
            mesh_hidden: sizes.mesh_hidden,
            rank: sizes.rank,
            had_attributes: self.had_attributes,
            step: self.step,
            unchanged: self.unchanged,
            rounds: self.rounds,
            best: self.best,
            note,
            array_steps: steps(&mut self.optimiser.arrays.iter().map(|adam| adam.steps)),
            basis_steps: self.optimiser.bases.steps,
            pose_steps: steps(&mut self.poses.iter().map(|pose| pose.adam.steps)),
            colour_steps: steps(&mut self.colours.iter().map(|colour| colour.adam.steps)),
        };
        let first = self.first.to_bytes()?;
        let motions: Vec<f32> = (self.motions.iter())
            .flat_map(|motion| {
                let root = motion.root_translation.to_array();
                motion.values().iter().copied().chain(root)
            })
            .collect();
        let poses = [
            flat(&self.poses, |pose| &pose.correction.0),
            flat(&self.poses, |pose| &pose.adam.first),
            flat(&self.poses, |pose| &pose.adam.second),
        ];
        let colours = [
            flat(&self.colours, |colour| &colour.numbers),
            flat(&self.colours, |colour| &colour.adam.first),
            flat(&self.colours, |colour| &colour.adam.second),
        ];
        let neighbours: Vec<u32> = (self.controllers.neighbours().iter().flatten())
            .map(|controller| u32::from(*controller))
            .collect();
        let mut writer = Writer::default();
        writer.bytes("first", &first);
        writer.numbers("motions", &motions);
        writer.indices("bound.triangles", self.bound.triangles());
        writer.numbers(
            "bound.barycentrics",
            self.bound.barycentrics().as_flattened(),
        );
        writer.indices("controllers.neighbours", &neighbours);
        writer.numbers(
            "controllers.masses",
            self.controllers.masses().as_flattened(),
        );
        for (name, array) in self.parameters.arrays() {
            writer.numbers(format!("parameters.{name}"), array);
        }
        let names = self.parameters.arrays().map(|(name, _)| name);
        for (name, adam) in names.into_iter().zip(&self.optimiser.arrays) {
            if name != BASES {
                writer.numbers(format!("first.{name}"), &adam.first);
                writer.numbers(format!("second.{name}"), &adam.second);
            }
        }
        writer.numbers("first.bases", &self.optimiser.bases.first);
        writer.numbers("second.bases", &self.optimiser.bases.second);
        for (name, numbers) in KINDS.into_iter().zip(&poses) {
            writer.numbers(format!("poses.{name}"), numbers);
        }
        for (name, numbers) in KINDS.into_iter().zip(&colours) {
            writer.numbers(format!("colours.{name}"), numbers);
        }
        writer.numbers("statistics.pull", &self.statistics.pull);
        writer.indices("statistics.seen", &self.statistics.seen);
        writer.write(path, &text)
    }

    /// Takes up a training of `capture` where it was written down, with the `perceptual` loss that it was begun with; also returns the note that was
    /// kept with it.
    ///
    /// # Errors
    /// A file that cannot be read, is damaged, or is of a training of another capture, or of this one before it was changed; another perceptual loss, or none where
    /// there was one.
    pub fn resume<N: DeserializeOwned>(
        capture: &'a Capture,
        path: &Path,
        perceptual: Option<Box<dyn PerceptualLoss>>,
    ) -> Result<(Self, N), TrainError> {
        let stored = Stored::read(path)?;
        let (reader, text) = stored.open::<Text<N>>()?;
        check(&text, capture, &reader)?;
        let given = perceptual.as_ref().map(|loss| loss.identity());
        if let Some(change) = other_loss(text.perceptual.as_deref(), given) {
            return Err(reader.refused(change));
        }
        text.options.check()?;
        let first = Avatar::read(Cursor::new(reader.bytes("first")?))?;
        let motions: Vec<MotionParams> = reader
            .numbers("motions", capture.frames() * CORRECTION)?
            .chunks_exact(CORRECTION)
            .map(|row| {
                let mut motion = MotionParams::default();
                motion.values_mut().copy_from_slice(&row[..PARAMS]);
                motion.root_translation = Vec3::from_slice(&row[PARAMS..]);
                motion
            })
            .collect();
        check_motions(&motions, capture.frames())?;
        let split = Split::new(capture, text.options.validation, text.options.seed)?;

        let controllers = controllers(&reader, text.gaussians, &first)?;
        let sizes = Sizes {
            gaussians: text.gaussians,
            vertices: first.template.vertices().len(),
            controllers: controllers.vertices().len(),
            controller_hidden: text.controller_hidden,
            bases: text.bases,
            mesh_hidden: text.mesh_hidden,
            rank: text.rank,
        };
        // Nothing is sized by the text before the tensors were found to have these sizes.
        let lengths = Parameters::lengths(&sizes)
            .ok_or_else(|| reader.refused("its sizes are no avatar's"))?;
        let mut parameters = Parameters::default();
        for ((name, array), length) in parameters.arrays_mut().into_iter().zip(lengths) {
            *array = reader.numbers(&format!("parameters.{name}"), length)?;
        }
        let bound = BoundGaussians::new(
            &first.template,
            reader.indices("bound.triangles", sizes.gaussians)?,
            reader
                .numbers("bound.barycentrics", 2 * sizes.gaussians)?
                .chunks_exact(2)
                .map(|pair| [pair[0], pair[1]])
                .collect(),
            parameters.gaussians.clone(),
        )?;
        let networks = shapes(&sizes, bound)?;
        let mut trainer = Self::of_parts(
            capture,
            (networks, controllers, first),
            motions,
            split,
            text.options.clone(),
        )?;
        trainer.perceptual = perceptual.map(Perceptual::new);
        trainer.had_attributes = text.had_attributes;
        trainer.parameters = parameters;
        trainer.step = text.step;
        trainer.unchanged = text.unchanged;
        trainer.rounds = text.rounds;
        trainer.best = text.best;
        trainer.read_moments(&reader, &text)?;
        Ok((trainer, text.note))
    }

    /// Reads what the optimisers and the statistics remember.
    fn read_moments<N>(&mut self, reader: &Reader<'_>, text: &Text<N>) -> Result<(), TrainError> {
        let names = self.parameters.arrays().map(|(name, _)| name);
        let arrays = self.optimiser.arrays.iter_mut().zip(&text.array_steps);
        for (name, (adam, steps)) in names.into_iter().zip(arrays) {
            adam.steps = *steps;
            if name != BASES {
                adam.first = reader.numbers(&format!("first.{name}"), adam.first.len())?;
                adam.second = reader.numbers(&format!("second.{name}"), adam.second.len())?;
            }
        }
        let bases = &mut self.optimiser.bases;
        bases.first = reader.numbers("first.bases", bases.first.len())?;
        bases.second = reader.numbers("second.bases", bases.second.len())?;
        bases.steps = text.basis_steps;
        let count = self.statistics.pull.len();
        self.statistics.pull = reader.numbers("statistics.pull", count)?;
        self.statistics.seen = reader.indices("statistics.seen", count)?;

        let read = |kind: &str, each: usize, count: usize| -> Result<Vec<Vec<f32>>, TrainError> {
            KINDS
                .iter()
                .map(|name| reader.numbers(&format!("{kind}.{name}"), each * count))
                .collect()
        };
        let poses = read("poses", CORRECTION, self.poses.len())?;
        let rows = self.poses.iter_mut().zip(&text.pose_steps).enumerate();
        for (frame, (pose, steps)) in rows {
            let row = frame * CORRECTION..(frame + 1) * CORRECTION;
            let mut correction = PoseCorrection::default();
            correction.0.copy_from_slice(&poses[0][row.clone()]);
            pose.correction = correction;
            pose.adam.first.copy_from_slice(&poses[1][row.clone()]);
            pose.adam.second.copy_from_slice(&poses[2][row]);
            pose.adam.steps = *steps;
        }
        let colours = read("colours", NUMBERS, self.colours.len())?;
        let rows = self.colours.iter_mut().zip(&text.colour_steps).enumerate();
        for (camera, (colour, steps)) in rows {
            let row = camera * NUMBERS..(camera + 1) * NUMBERS;
            colour.numbers.copy_from_slice(&colours[0][row.clone()]);
            colour.adam.first.copy_from_slice(&colours[1][row.clone()]);
            colour.adam.second.copy_from_slice(&colours[2][row]);
            colour.adam.steps = *steps;
        }
        Ok(())
    }
}

/// An array's numbers, then Adam's two means of their derivatives.
const KINDS: [&str; 3] = ["numbers", "first", "second"];

/// Refuses a checkpoint of another program or capture, or whose sizes and counts are no training's.
fn check<N>(text: &Text<N>, capture: &Capture, reader: &Reader<'_>) -> Result<(), TrainError> {
    if !(OLDEST..=VERSION).contains(&text.version) {
        return Err(reader.refused(format!(
            "it is of version {}, this program reads {OLDEST} to {VERSION}; begin anew without --resume",
            text.version
        )));
    }
    if let Some(change) = text.source.change(&Source::of(capture)) {
        return Err(reader.refused(change));
    }
    let units = [
        text.controller_hidden,
        text.bases,
        text.mesh_hidden[0],
        text.mesh_hidden[1],
        text.rank,
    ];
    let sound = text.gaussians <= MAX_GAUSSIANS
        && units.iter().all(|count| *count <= MOST_UNITS)
        && text.array_steps.len() == ARRAYS
        && text.pose_steps.len() == capture.frames()
        && text.colour_steps.len() == capture.cameras().len()
        && text.step <= MOST_STEPS
        && u64::from(text.unchanged) <= text.step
        && text.best.is_none_or(f64::is_finite);
    if sound {
        Ok(())
    } else {
        Err(reader.refused("its sizes are no avatar's"))
    }
}

/// Why a training cannot go on with the perceptual loss that is given, and what to do. Both are told by their identities.
fn other_loss(begun: Option<&str>, given: Option<&str>) -> Option<String> {
    match (begun, given) {
        (Some(begun), None) => Some(format!(
            "it was begun with a perceptual loss, the network of SHA-256 {begun}: name its file as well (--lpips)"
        )),
        (None, Some(_)) => Some(
            "it was begun without a perceptual loss: go on without one (leave --lpips out), or train anew".to_owned(),
        ),
        (Some(begun), Some(given)) if begun != given => Some(format!(
            "it was begun with another perceptual loss, the network of SHA-256 {begun}, not {given}: name that one's file (--lpips), or train anew"
        )),
        _ => None,
    }
}

/// Arrays of [`Parameters`].
const ARRAYS: usize = 14;

/// The controllers of the population that was written down.
fn controllers(
    reader: &Reader<'_>,
    gaussians: usize,
    first: &Avatar,
) -> Result<Controllers, TrainError> {
    let count = gaussians;
    let neighbours = reader
        .indices("controllers.neighbours", NEIGHBOURS * count)?
        .chunks_exact(NEIGHBOURS)
        .map(|row| {
            let mut three = [0u16; NEIGHBOURS];
            for (out, controller) in three.iter_mut().zip(row) {
                *out = u16::try_from(*controller)
                    .map_err(|_| reader.refused("there is no controller of such a number"))?;
            }
            Ok(three)
        })
        .collect::<Result<Vec<_>, TrainError>>()?;
    let masses = reader
        .numbers("controllers.masses", NEIGHBOURS * count)?
        .chunks_exact(NEIGHBOURS)
        .map(|row| std::array::from_fn(|k| row[k]))
        .collect();
    let vertices = first.controllers.vertices().to_vec();
    Ok(Controllers::new(
        &first.template,
        vertices,
        neighbours,
        masses,
    )?)
}

/// Networks of these sizes whose numbers are all 0: the checkpoint has the numbers in full precision.
fn shapes(sizes: &Sizes, bound: BoundGaussians) -> Result<Networks, TrainError> {
    debug_assert!(sizes.controllers <= MAX_CONTROLLERS, "a package was read");
    let layer = |inputs: usize, outputs: usize| {
        Dense::new(
            inputs,
            outputs,
            &vec![0.0; inputs * outputs],
            vec![0.0; outputs],
        )
    };
    let units = sizes.controllers * sizes.controller_hidden;
    let [first, second] = sizes.mesh_hidden;
    let columns = 3 * sizes.vertices;
    let zeros = vec![0.0; ATTRIBUTES * sizes.bases * sizes.gaussians];
    Ok(Networks {
        gaussians: bound,
        mesh: MeshNetwork {
            first: layer(PARAMS, first)?,
            second: layer(first, second)?,
            code: layer(second, sizes.rank)?,
            decoder: QuantisedDecoder::quantise(
                sizes.rank,
                &vec![0.0; sizes.rank * columns],
                vec![0.0; columns],
            )?,
        },
        attributes: AttributeNetwork {
            first: layer(PARAMS, units)?,
            second: vec![f16::ZERO; units * sizes.bases],
            second_bias: vec![0.0; sizes.controllers * sizes.bases],
            bases: QuantisedBases::quantise(sizes.bases, sizes.gaussians, &zeros)?,
        },
    })
}
