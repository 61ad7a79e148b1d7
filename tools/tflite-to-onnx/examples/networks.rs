//! How long the networks in `MON3TR_NETWORKS` take to convert, to load and to run with one thread:
//! `eval "$(./run env)"; cargo run --release --package tflite-to-onnx --example networks`
#![allow(missing_docs, reason = "an example has no interface")]

use npu_runtime::{Provider, Runtime, Session, TensorSpec};
use std::error::Error;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tflite_to_onnx::{Options, Port, convert};

/// Each network, with the outputs that are used of it.
const NETWORKS: [(&str, Option<&[usize]>); 10] = [
    ("pose_detection", None),
    ("pose_landmark_full", None),
    ("pose_landmark_full", Some(&[0, 1, 4])),
    ("pose_landmark_heavy", Some(&[0, 1, 3, 4])),
    ("hand_recrop", None),
    ("hand_landmark_full", None),
    ("hand_landmark_lite", None),
    ("palm_detection_full", None),
    ("face_detection_short_range", None),
    ("face_landmark_with_attention", None),
];

/// The shortest and the median of `times` calls, in milliseconds.
fn measure(
    times: usize,
    mut call: impl FnMut() -> Result<(), Box<dyn Error>>,
) -> Result<(f64, f64), Box<dyn Error>> {
    let mut spent = Vec::with_capacity(times);
    for _ in 0..times {
        let start = Instant::now();
        call()?;
        spent.push(start.elapsed());
    }
    spent.sort_unstable();
    let ms = |at: usize| spent.get(at).map_or(0.0, Duration::as_secs_f64) * 1e3;
    Ok((ms(0), ms(times / 2)))
}

fn specs(ports: &[Port]) -> Vec<TensorSpec> {
    ports
        .iter()
        .map(|port| TensorSpec::new(&port.name, &port.shape))
        .collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::var_os("MON3TR_NETWORKS").ok_or("MON3TR_NETWORKS is not set")?;
    let folder = PathBuf::from(folder);
    let runtime = Runtime::open(None)?;
    println!("shortest / median, ms      convert         load          run, one thread");
    for (name, kept) in NETWORKS {
        let tflite = std::fs::read(folder.join(format!("{name}.tflite")))?;
        let options = Options {
            outputs: kept.map(<[usize]>::to_vec),
        };
        let converted = convert(&tflite, &options)?;
        let conversion = measure(9, || {
            convert(&tflite, &options)?;
            Ok(())
        })?;
        let (inputs, outputs) = (specs(&converted.inputs), specs(&converted.outputs));
        let provider = Provider::Cpu { threads: 1 };
        let open = || Session::new(&runtime, &converted.onnx, provider, &inputs, &outputs);
        let load = measure(3, || {
            open()?;
            Ok(())
        })?;
        let mut session = open()?;
        for index in 0..inputs.len() {
            session.input_mut(index).fill(0.5);
        }
        let mut results = session.outputs()?;
        session.run(&mut results)?;
        let run = measure(100, || Ok(session.run(&mut results)?))?;
        let kept = kept.map_or(String::new(), |kept| format!(" {kept:?}"));
        println!(
            "{:<40} {:5.1} / {:5.1}  {:5.0} / {:5.0}  {:6.2} / {:6.2}",
            format!("{name}{kept}"),
            conversion.0,
            conversion.1,
            load.0,
            load.1,
            run.0,
            run.1
        );
    }
    Ok(())
}
