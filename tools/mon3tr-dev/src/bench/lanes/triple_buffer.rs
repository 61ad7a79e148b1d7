//! What handing over costs: giving and taking by one thread, and from giving until a sleeping thread has it. The yardstick is a
//! channel of the standard library, which queues where lanes keep the newest.

use super::super::measure::{median, print_table};
use anyhow::anyhow;
use app_pipeline::lanes::{WakeSignal, triple_buffer};
use serde::Serialize;
use std::hint::black_box;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

const BATCH: u32 = 4096;
const ROUNDS: usize = 101;
/// Values handed to a sleeper.
const WAKES: usize = 1001;
/// Between them, for the readers to fall asleep.
const PAUSE: Duration = Duration::from_micros(300);
/// Longer than a reader ever sleeps.
const PATIENCE: Duration = Duration::from_secs(10);

/// Nanoseconds of a lane's hand-over and of a channel's.
#[derive(Debug, Serialize)]
pub(super) struct HandOver {
    what: &'static str,
    ours_ns: Vec<f64>,
    channel_ns: Vec<f64>,
    ours_median_ns: f64,
    channel_median_ns: f64,
    ratio: f64,
}

impl HandOver {
    fn new(what: &'static str, [ours_ns, channel_ns]: [Vec<f64>; 2]) -> Self {
        let (ours, its) = (median(&ours_ns), median(&channel_ns));
        Self {
            what,
            ours_ns,
            channel_ns,
            ours_median_ns: ours,
            channel_median_ns: its,
            ratio: ours / its,
        }
    }
}

pub(super) fn measure() -> anyhow::Result<[HandOver; 2]> {
    Ok([
        HandOver::new("give and take, one thread", on_one_thread()?),
        HandOver::new("until a sleeper has it", to_a_sleeper()?),
    ])
}

pub(super) fn print(measured: &[HandOver]) {
    println!("Hand-over: medians of {ROUNDS} rounds of {BATCH}, and of {WAKES} wakings\n");
    let row = |one: &HandOver| {
        vec![
            one.what.to_owned(),
            format!("{:.0}", one.ours_median_ns),
            format!("{:.0}", one.channel_median_ns),
            format!("{:.2}", one.ratio),
        ]
    };
    let headings = ["hand-over", "ours ns", "mpsc channel ns", "ours / its"];
    print_table(&headings, &measured.iter().map(row).collect::<Vec<_>>());
}

fn on_one_thread() -> anyhow::Result<[Vec<f64>; 2]> {
    let (mut writer, mut reader) = triple_buffer([0; 3], &WakeSignal::default());
    let (sender, receiver) = channel();
    let each = |since: Instant| since.elapsed().as_secs_f64() * 1e9 / f64::from(BATCH);
    let (mut ours, mut its) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let since = Instant::now();
        for value in 0..BATCH {
            *writer.place() = black_box(value);
            writer.give();
            reader.take();
            black_box(*reader.taken());
        }
        ours.push(each(since));
        let since = Instant::now();
        for value in 0..BATCH {
            sender.send(black_box(value))?;
            black_box(receiver.recv()?);
        }
        its.push(each(since));
    }
    Ok([ours, its])
}

fn to_a_sleeper() -> anyhow::Result<[Vec<f64>; 2]> {
    let bell = WakeSignal::default();
    // Nothing stands for the end: the newest wins, so it always arrives.
    let (mut writer, mut reader) = triple_buffer([None::<Instant>; 3], &bell);
    let (sender, receiver) = channel::<Instant>();
    let since = |given: Instant| given.elapsed().as_secs_f64() * 1e9;
    std::thread::scope(|scope| {
        let ours = scope.spawn(move || {
            let mut times = Vec::with_capacity(WAKES);
            loop {
                bell.wait(PATIENCE);
                if !reader.take() {
                    continue;
                }
                match reader.taken() {
                    Some(given) => times.push(since(*given)),
                    None => return times,
                }
            }
        });
        let its = scope.spawn(move || receiver.iter().map(since).collect::<Vec<f64>>());
        for _ in 0..WAKES {
            std::thread::sleep(PAUSE);
            *writer.place() = Some(Instant::now());
            writer.give();
            std::thread::sleep(PAUSE);
            sender.send(Instant::now())?;
        }
        *writer.place() = None;
        writer.give();
        drop(sender);
        let ended = |_| anyhow!("a thread that was to be woken panicked");
        Ok([ours.join().map_err(ended)?, its.join().map_err(ended)?])
    })
}
