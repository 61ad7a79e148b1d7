//! A loudspeaker beside a microphone: what comes back to the one who speaks.

use crate::command::command;
use crate::house::{House, Program};
use crate::voice::{read_wav, write_wav};
use test_support::pulse::Pulse;
use test_support::speech::talk;

/// Samples a second.
const RATE: usize = link_voice::RATE as usize;
/// Seconds of the call, and after which the canceller knows the room.
const SECONDS: usize = 20;
const SETTLED: usize = 10;

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
    let voice = talk();
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
