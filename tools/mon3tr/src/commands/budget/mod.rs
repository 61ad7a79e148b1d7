//! `mon3tr budget`: what a picture will take on a headset that is not here.

mod people;
mod predictions;
mod report;

use crate::commands::bake::{BakeChoices, baked_demo_avatar};
use crate::device_options::{DeviceOptions, describe};
use crate::report::{check_writable, write_json};
use crate::size::Size;
use crate::stills::load_avatar;
use anyhow::ensure;
use frame_budget::{QUEST_3, ShaderCosts};
use people::Posed;
use predictions::{Budget, Crowd};
use std::path::PathBuf;

/// The most people that are reckoned with.
const MOST_PEOPLE: usize = 4;

/// Options of `budget`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Avatar packages (.m3a): of one to four people, from left to right; fewer than four are there several times [default: the demo avatar]
    #[arg(value_name = "PACKAGE", num_args = 0..=MOST_PEOPLE)]
    packages: Vec<PathBuf>,
    #[command(flatten)]
    bake: BakeChoices,
    /// Size of one eye's picture on the headset, pixels
    #[arg(long, value_name = "WxH", default_value = "1680x1760")]
    size: Size,
    /// From the viewer to each person, metres
    #[arg(long, value_name = "METRES", default_value_t = app_session::presence::DISTANCE)]
    distance: f32,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Runs `budget`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    ensure!(
        (0.3..=10.0).contains(&options.distance),
        "--distance {} is not within 0.3 and 10 metres",
        options.distance
    );
    let packages = if options.packages.is_empty() {
        vec![baked_demo_avatar(&options.bake, device)?]
    } else {
        options.packages.clone()
    };
    let runtime = device.runtime()?;
    let posed = (packages.iter())
        .map(|package| Posed::at_ease(&load_avatar(package)?.0, &runtime))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let gpu = device.gpu()?;
    println!(
        "counting the work of pictures on {}; a minute or two",
        describe(&gpu)
    );
    let costs = ShaderCosts::of_table();
    let crowds = (1..=MOST_PEOPLE)
        .map(|count| {
            let people: Vec<&Posed> = posed.iter().cycle().take(count).collect();
            Crowd::predict(
                &people,
                options.size,
                options.distance,
                &gpu,
                &costs,
                &QUEST_3,
            )
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let budget = Budget {
        headset: QUEST_3.name,
        eye: [options.size.width, options.size.height],
        distance_metres: options.distance,
        crowds,
    };
    report::print(&budget, &QUEST_3);
    write_json(options.json.as_deref(), &budget)
}
