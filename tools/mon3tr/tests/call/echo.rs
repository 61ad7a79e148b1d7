//! A loudspeaker beside a microphone: what comes back to the one who speaks.

use crate::command::command;
use crate::house::{House, Program};
use crate::voice::{read_wav, write_wav};
use test_support::pulse::Pulse;

/// Samples a second.
const RATE: usize = link_voice::RATE as usize;
/// Seconds of the call, and after which the canceller knows the room.
const SECONDS: usize = 20;
const SETTLED: usize = 10;

/// Syllables of a voice whose pitch, formants and pauses vary: what a gain controller takes for speech.
fn voice() -> Vec<f32> {
    let (mut random, mut phase, mut states) = (7u32, 0.0f32, [[0.0f32; 2]; 2]);
    let mut next = move || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as f32 / (1u32 << 24) as f32
    };
    let mut out = Vec::new();
    while out.len() < 5 * RATE {
        let (pitch, low, high) = (
            100.0 + 60.0 * next(),
            300.0 + 500.0 * next(),
            900.0 + 1400.0 * next(),
        );
        let (length, loud) = (RATE / 6, if next() < 0.25 { 0.0 } else { 1.0 });
        for k in 0..length {
            let envelope = (k as f32 / length as f32 * std::f32::consts::PI).sin();
            phase = (phase + pitch / RATE as f32).fract();
            let mut sample = if phase < 0.6 { phase } else { 0.0 } - 0.18 + 0.02 * next();
            for (state, hz) in states.iter_mut().zip([low, high]) {
                let (radius, angle) = (0.99, std::f32::consts::TAU * hz / RATE as f32);
                let (b, c) = (2.0 * radius * angle.cos(), -radius * radius);
                sample = (1.0 - b - c) * sample + b * state[0] + c * state[1];
                *state = [sample, state[0]];
            }
            out.push(loud * envelope * sample);
        }
    }
    out.truncate(5 * RATE);
    let power = out.iter().map(|sample| sample * sample).sum::<f32>() / out.len() as f32;
    let scale = 0.1 / power.sqrt();
    for sample in &mut out {
        *sample = (*sample * scale).clamp(-0.9, 0.9);
    }
    out
}

/// Mean square in dB of full scale.
fn level(samples: &[f32]) -> f32 {
    let power = samples.iter().map(|sample| sample * sample).sum::<f32>() / samples.len() as f32;
    10.0 * power.max(1e-12).log10()
}

#[test]
fn who_speaks_to_a_person_without_headphones_does_not_hear_themselves() {
    let Some(pulse) = Pulse::start() else { return };
    let mut house = House::open();
    house.sound = pulse.socket();
    // What the loudspeaker plays goes through the air, 60 ms, to the microphone. There it is as loud as it was played.
    pulse.add("module-null-sink", "sink_name=loudspeaker");
    pulse.add("module-null-sink", "sink_name=air");
    pulse.add(
        "module-loopback",
        "source=loudspeaker.monitor sink=air latency_msec=60",
    );
    let [said, heard] = ["said.wav", "heard.wav"].map(|name| house.path(name));
    let voice = voice();
    write_wav(&said, link_voice::RATE, &voice);
    let begin = |name: &str, arguments: &[&str]| {
        let (avatar, json) = (house.avatar.to_string_lossy(), house.new_report());
        let first = ["call", "--avatar", &avatar, "--json", &json];
        let mut command = command(&[first.as_slice(), &["--display", "none"], arguments].concat());
        let cache = house.folder.path().join(name);
        Program::start_as(&house, &cache, command.env("RUST_LOG", "link=info"))
    };
    let (server, token) = (format!("http://{}", house.address), house.owner_token());
    let seconds = SECONDS.to_string();
    let mut ada = begin(
        "ada",
        &[
            "--server",
            &server,
            "--owner-token",
            &token,
            "--voice",
            &said,
            "--sound",
            &heard,
            "--seconds",
            &seconds,
        ],
    );
    let link = ada.word_after("mon3tr call ");
    let devices = [
        "--microphone",
        "air.monitor",
        "--loudspeaker",
        "loudspeaker",
    ];
    let mut bob = begin("bob", &[&[link.as_str()], devices.as_slice()].concat());
    for person in [&mut ada, &mut bob] {
        person.says("joined (session", 1);
    }
    // What the microphone hears, taken from the same air.
    let server = sound_devices::SoundServer::at(pulse.socket());
    let mut air =
        sound_devices::Microphone::open(&server, Some("air.monitor")).expect("a microphone");
    let mut in_the_air = vec![0.0; SETTLED * RATE];
    air.skip();
    for frame in in_the_air.chunks_mut(RATE / 50) {
        air.next(frame, std::time::Duration::from_secs(4));
    }
    ada.report();
    let packets = crate::house::count(&bob.ends()["sent"], "voice_sent");
    let heard = read_wav(&heard);
    let settled = &heard[(SETTLED * RATE).min(heard.len())..];
    let echo = level(&in_the_air[3 * RATE..]);
    println!(
        "said at {:.1} dBFS, heard by the microphone at {echo:.1}, by who said it at {:.1}; {packets} packets came back",
        level(&voice),
        level(settled),
    );
    assert!(settled.len() > 5 * RATE, "{} samples", settled.len());
    assert!(packets > 100, "nothing was sent back: {packets} packets");
    assert!(
        (echo - level(&voice)).abs() < 6.0,
        "the microphone heard {echo:.1} dBFS"
    );
    // 30 dB and more on a quiet machine, as the processing's own tests assert; where other tests delay both devices, less.
    assert!(
        level(settled) <= echo - 20.0,
        "heard themselves at {:.1} dBFS",
        level(settled)
    );
}
