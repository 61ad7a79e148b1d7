//! Several people on a display without a headset.

use crate::command::command;
use crate::house::{House, Program, count};
use crate::voice::{read_both, write_wav};
use image::RgbImage;
use serde_json::Value;
use synthetic_person::{Puppet, PuppetSize};
use test_support::speech::{loudness_at, sung};
use test_support::{onnx, vulkan};

/// Gaussians of the first person, and of the other.
const GAUSSIANS: [u64; 2] = [2_000, 1_500];

/// Whether a pixel shows a person: the studio's greys have no colour.
fn is_person(picture: &RgbImage, x: u32, y: u32) -> bool {
    let pixel = picture.get_pixel(x, y).0;
    let [most, least] = [pixel.iter().max(), pixel.iter().min()];
    most.zip(least)
        .is_some_and(|(most, least)| most - least > 40)
}

/// The highest row with people.
fn top(picture: &RgbImage) -> u32 {
    let row = |y: u32| (0..picture.width()).any(|x| is_person(picture, x, y));
    (0..picture.height()).find(|y| row(*y)).expect("people")
}

/// Groups of neighbouring columns with people, among so many rows from the highest on.
fn groups(picture: &RgbImage, rows: u32) -> usize {
    let top = top(picture);
    let column = |x| (top..top + rows).any(|y| is_person(picture, x, y));
    let columns: Vec<bool> = (0..picture.width()).map(column).collect();
    let begins = |at: &usize| columns[*at] && (*at == 0 || !columns[at - 1]);
    (0..columns.len()).filter(begins).count()
}

/// What two people's senders show in pictures: the report, and the last picture.
fn received(house: &House, links: [&str; 2], name: &str, options: &[&str]) -> (Value, RgbImage) {
    let (out, json) = (house.path(name), house.new_report());
    let mut command = command(&["receive", links[0], links[1], "--display", "offscreen"]);
    command
        .args(["--size", "200x150", "--view", "front"])
        .args(["--out", &out, "--json", &json])
        .args(options);
    let report = Program::start_as(house, out.as_ref(), &mut command).report();
    let last = image::open(format!("{out}/last.png")).expect("a picture");
    (report, last.to_rgb8())
}

#[test]
fn two_people_stand_or_sit_side_by_side_in_pictures_and_each_has_figures() {
    if vulkan::gpu().is_none() || onnx::runtime().is_none() {
        return;
    }
    let (house, second) = (House::open(), House::open());
    let other = PuppetSize {
        gaussians: usize::try_from(GAUSSIANS[1]).expect("few"),
        ..PuppetSize::SMALL
    };
    let saved = Puppet::new(other).avatar().save(&second.avatar);
    saved.expect("another made-up person");
    let senders = [&house, &second].map(|house| house.sender(&[]));
    let links = [&senders[0].viewers[..], &senders[1].viewers[..]];

    let (report, standing) = received(&house, links, "standing", &["--frames", "20"]);
    assert_eq!(standing.dimensions(), (200, 150), "the size asked for");
    assert_eq!(groups(&standing, 10), 2, "two heads side by side");
    let others = report["others"].as_array().expect("others");
    let avatars = [&report["avatar"], &others[0]["avatar"]];
    let gaussians = avatars.map(|avatar| count(avatar, "gaussians"));
    assert_eq!(gaussians, GAUSSIANS, "in the order of the links");
    for of in [&report["drawing"], &others[0]] {
        let measured = &of["measured"];
        let shown = count(&measured["pictures"], "shown");
        assert!(shown >= 15, "each is in the pictures: {of:#}");
        assert!(of["placement"]["plan"].is_string(), "{of:#}");
        assert!(measured["latency"]["whole"]["p50_ms"].is_number(), "{of:#}");
    }

    let (_, seated) = received(&house, links, "seated", &["--seat", "--frames", "20"]);
    let [up, down] = [&standing, &seated].map(top);
    assert!(down >= up + 8, "seated heads are lower: row {down}, {up}");
}

#[test]
fn each_of_two_people_is_heard_from_where_they_are_seen() {
    if vulkan::gpu().is_none() || onnx::runtime().is_none() {
        return;
    }
    let house = House::open();
    let pitches = [800.0, 1_300.0];
    let senders = [0, 1].map(|number| {
        let said = house.path(&format!("said-{number}.wav"));
        write_wav(&said, link_voice::RATE, &sung(1, pitches[number]));
        house.sender(&["--voice", &said])
    });
    let links = [&senders[0].viewers[..], &senders[1].viewers[..]];
    let heard = house.path("heard.wav");
    received(
        &house,
        links,
        "heard",
        &["--sound", &heard, "--frames", "200"],
    );
    let heard = read_both(&heard);
    for (number, pitch) in pitches.into_iter().enumerate() {
        let ears = [0, 1].map(|ear| {
            let samples: Vec<f32> = heard.iter().map(|both| both[ear]).collect();
            // The last second: everyone had a place by then.
            let last = samples.len().saturating_sub(link_voice::RATE as usize);
            loudness_at(&samples[last..], pitch).iter().sum::<f32>()
        });
        let louder = 20.0 * (ears[0] / ears[1]).log10();
        println!("person {number} is louder in the left ear by {louder:.2} dB");
        assert!(ears[0] > 0.1, "they speak: {ears:?}");
        // The first one stands on the left.
        let side = if number == 0 { louder } else { -louder };
        assert!(
            (0.3..6.0).contains(&side),
            "person {number}: {louder:.2} dB"
        );
    }
}
