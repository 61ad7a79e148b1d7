//! What one side says is what the other hears, between real processes.

use crate::house::{House, Program, count, number, through, wait_for};
use netlab::{Impairment, Jitter, Loss, Probability};
use sound_devices::{Loudspeaker, Microphone, SoundServer};
use std::path::Path;
use std::time::{Duration, Instant};
use test_support::pulse::Pulse;
use test_support::speech::{PIECE, STEP, WINDOW, best_likeness, loudness, syllables};
use test_support::{onnx, vulkan};

/// One channel of 32 bits.
pub(crate) fn write_wav(path: impl AsRef<Path>, sample_rate: u32, samples: &[f32]) {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut wav = hound::WavWriter::create(path, spec).expect("a file");
    for sample in samples {
        wav.write_sample(*sample).expect("a sample");
    }
    wav.finalize().expect("a file");
}

/// Of what a program wrote.
pub(crate) fn read_wav(path: &str) -> Vec<f32> {
    let mut wav = hound::WavReader::open(path).expect("what was heard");
    wav.samples::<i16>()
        .map(|sample| f32::from(sample.expect("a sample")) / 32_768.0)
        .collect()
}

#[test]
fn what_is_said_is_heard_through_delay_and_loss() {
    let house = House::open();
    let (said, heard) = (house.path("said.wav"), house.path("heard.wav"));
    let spoken = syllables(1);
    write_wav(&said, link_voice::RATE, &spoken);

    let down = Impairment {
        delay: Duration::from_millis(40),
        loss: Loss::Independent(Probability::new(0.03).expect("a share")),
        ..Impairment::default()
    };
    let lab = house.lab(down, Impairment::default());
    let sender = house.sender(&["--voice", &said, "--seconds", "12"]);
    let receiver = house.receiver(
        &through(&lab, &sender.viewers),
        "viewer",
        &["--sound", &heard],
    );
    let sent = sender.program.report();
    let received = receiver.report();
    house.runtime.block_on(lab.stop());
    let voice = &received["call"]["voice"];
    println!("{voice:#}");
    let packets = count(&sent, "voice_sent");
    assert!(packets > 300, "{packets} packets were sent");
    assert!(count(voice, "received") * 10 > packets * 9, "{voice:#}");
    assert_eq!(count(voice, "refused"), 0, "{voice:#}");
    // The end of the call cut nothing off.
    assert_eq!(
        count(voice, "received"),
        count(voice, "decoded") + count(voice, "late") + count(voice, "overflowed"),
        "{voice:#}"
    );

    let (spoken, heard) = (loudness(&spoken), loudness(&read_wav(&heard)));
    // Where the delay changes, periods are left out or repeated: pieces are compared, and the beginning, where it settles, is left out.
    let pieces = heard.chunks_exact(PIECE).skip(1);
    let mut alike: Vec<f32> = pieces.map(|piece| best_likeness(&spoken, piece)).collect();
    println!("{alike:?} alike");
    assert!(alike.len() >= 3, "{} pieces were heard", alike.len());
    alike.sort_by(f32::total_cmp);
    assert!(alike[alike.len() / 2] > 0.85, "{alike:?} alike");
}

#[test]
fn what_is_heard_and_what_is_seen_of_one_moment_come_together() {
    let house = House::open();
    let (said, heard) = (house.path("said.wav"), house.path("heard.wav"));
    write_wav(&said, link_voice::RATE, &syllables(1));
    let down = Impairment {
        delay: Duration::from_millis(40),
        jitter: Jitter::Uniform(Duration::from_millis(15)),
        ..Impairment::default()
    };
    // Where nothing is drawn, motion is ready first and waits; pictures are late, and voice waits for them.
    for display in ["none", "offscreen"] {
        if display != "none" && (vulkan::gpu().is_none() || onnx::runtime().is_none()) {
            return;
        }
        let lab = house.lab(down.clone(), Impairment::default());
        let sender = house.sender(&["--voice", &said, "--seconds", "14"]);
        let link = through(&lab, &sender.viewers);
        let (json, out) = (house.new_report(), house.path("pictures"));
        let first = ["receive", &link, "--display", display, "--json", &json];
        let more = ["--sound", &heard, "--out", &out, "--size", "160x120"];
        let mut command = crate::command::command(&[first.as_slice(), &more].concat());
        let receiver = Program::start_as(&house, house.folder.path(), &mut command);
        sender.program.report();
        let received = receiver.report();
        house.runtime.block_on(lab.stop());
        let call = &received["call"];
        let latency = &call["latency"];
        let (apart, ear) = (&latency["voice_apart"], &latency["mouth_to_ear"]);
        println!("{display}: {apart:#} {ear:#}");
        assert!(number(apart, "count") > 200.0, "{latency:#}");
        // `netlab --voice` says how well; here it is only not to be far off.
        assert!(number(apart, "p50_ms") <= 20.0, "{display}: {apart:#}");
        // The way, the two frames that Opus and the packet take, and what is asked for at a time.
        assert!(number(ear, "p50_ms") >= 40.0 + 20.0, "{display}: {ear:#}");
    }
}

/// Says `spoken` again and again from this loudspeaker.
fn speak(server: &SoundServer, name: &str, spoken: &[f32]) -> Loudspeaker {
    let (spoken, mut next) = (spoken.to_vec(), 0);
    let fill = move |_: Instant, _: Duration, out: &mut [f32]| {
        for out in out {
            *out = spoken[next];
            next = (next + 1) % spoken.len();
        }
    };
    Loudspeaker::begin(server, Some(name), Box::new(fill)).expect("a loudspeaker")
}

/// What a microphone hears in the next pieces.
fn listen(microphone: &mut Microphone, pieces: usize) -> Vec<f32> {
    let mut heard = vec![0.0; pieces * PIECE * STEP];
    microphone.skip();
    for frame in heard.chunks_mut(WINDOW) {
        microphone.next(frame, Duration::from_secs(4));
    }
    loudness(&heard)
}

#[test]
fn a_microphone_is_heard_from_a_loudspeaker_also_after_it_was_away() {
    let Some(pulse) = Pulse::start() else { return };
    let server = SoundServer::at(pulse.socket());
    let mut house = House::open();
    house.sound = pulse.socket();
    let mouth = pulse.add("module-null-sink", "sink_name=mouth");
    pulse.add("module-null-sink", "sink_name=ears rate=44100");
    let spoken = syllables(1);
    let speaking = speak(&server, "mouth", &spoken);
    let mut sender = house.sender(&["--microphone", "mouth.monitor"]);
    let mut receiver = house.receiver(&sender.viewers, "viewer", &["--loudspeaker", "ears"]);
    receiver.says("joined (session", 1);
    let mut ears = Microphone::open(&server, Some("ears.monitor")).expect("a microphone");
    let loud = loudness(&spoken);
    let is_heard = |ears: &mut Microphone| {
        let alike = best_likeness(&loud, &listen(ears, 1));
        println!("{alike} alike");
        (alike > 0.85).then_some(())
    };
    wait_for("what is said", || is_heard(&mut ears));

    drop(speaking);
    pulse.remove(mouth);
    sender
        .program
        .says("the microphone mouth.monitor is away", 1);
    listen(&mut ears, 1);
    let silence = listen(&mut ears, 1).into_iter().fold(0.0, f32::max);
    assert!(silence < 0.01, "{silence} loud without a microphone");
    assert!(sender.program.is_running() && receiver.is_running());

    pulse.add("module-null-sink", "sink_name=mouth");
    sender
        .program
        .says("the microphone mouth.monitor is back", 1);
    let speaking = speak(&server, "mouth", &spoken);
    wait_for("what is said again", || is_heard(&mut ears));
    drop(speaking);
    sender.program.ask_to_end();
    let (_, said) = sender.program.report_and_said();
    assert_eq!(said.matches("is away").count(), 1, "{said}");
    let received = receiver.report();
    let voice = &received["call"]["voice"];
    println!("{voice:#}");
    assert!(count(voice, "decoded") > 100, "{voice:#}");
}

#[test]
fn devices_that_are_not_there_are_named_in_one_line() {
    let mut house = House::open();
    let sent = house.send(&["--avatar", &house.avatar.to_string_lossy(), "--microphone"]);
    let said = sent.fails();
    assert!(
        said.contains("no microphone: no sound server runs here"),
        "{said}"
    );
    let sender = house.sender(&["--seconds", "2"]);
    // Without having asked for one, others are seen all the same.
    let receiver = house.receiver(&sender.viewers, "viewer", &[]);
    sender.program.report();
    receiver.report();
    let Some(pulse) = Pulse::start() else { return };
    house.sound = pulse.socket();
    pulse.add("module-null-sink", "sink_name=ears");
    let sent = house.send(&[
        "--avatar",
        &house.avatar.to_string_lossy(),
        "--microphone",
        "headset",
    ]);
    let said = sent.fails();
    assert!(
        said.contains("headset") && said.contains("ears.monitor"),
        "{said}"
    );
}

#[test]
fn what_is_no_voice_is_refused_in_one_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let package = crate::command::puppet(&folder);
    let package = crate::command::text(&package);
    let file = |name: &str| folder.path().join(name);
    write_wav(file("slow.wav"), 16_000, &[0.1]);
    write_wav(file("empty.wav"), link_voice::RATE, &[]);
    std::fs::write(file("text.wav"), "no sound").expect("a file");
    for (name, words) in [
        ("slow.wav", "16000 Hz"),
        ("empty.wav", "0 samples"),
        ("text.wav", "no voice"),
        ("nothing.wav", "no voice"),
    ] {
        let path = file(name);
        let path = crate::command::text(&path);
        crate::command::mon3tr(&["send", "--avatar", package, "--voice", path])
            .fails_naming(&[name, words]);
    }
}
