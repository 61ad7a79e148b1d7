//! A call of several: the app takes a seat by the call's link, and a real `mon3tr call` is there. Each sees the other move, and hears what the
//! other says. The headset's microphone and loudspeaker are files (`shims/libaaudio.c`).

use super::activities::shows_a_notice;
use super::call::shows_people;
use super::{DESTRUCTION_MS, Figures, assert_well, figure};
use crate::environment::{Environment, Scene, Server, opening_call};
use crate::process::LEAVE;
use android_rehearsal::protocol::Callback;
use anyhow::{Context, ensure};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;
use synthetic_person::PuppetSize;
use test_support::monado::Compositor;
use test_support::program::Program;
use test_support::speech::{PIECE, RATE, best_likeness, loudness, syllables, talk};

/// What the one at the desk says. The wearer says something of another pitch: two voices of one steady pitch that speak at the same time do not come
/// through the voice processing as they were.
pub(super) fn desk_voice() -> Vec<f32> {
    syllables(5)
}

/// How long they talk before and after the devices were away: several of the pieces that are compared.
const TALK: Duration = Duration::from_secs(12);
/// The least likeness of the best piece, as a correlation of loudness. The wearer's voice goes through noise suppression and gain control besides.
pub(super) const LIKE: f32 = 0.8;
/// The most likeness with the voice of another, of any piece.
pub(super) const UNLIKE: f32 = 0.6;

/// The avatar of the app's folder.
pub(super) const AVATAR: &str = "avatar.m3a";

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let server = scene.server(PuppetSize::SMALL)?;
    fs::create_dir_all(scene.external())?;
    fs::copy(&server.avatar, scene.external().join(AVATAR))?;
    let path = |name: &str| scene.folder.join(name);
    let (microphone, loudspeaker, away) = (path("said.f32"), path("heard.f32"), path("away"));
    write_raw(&microphone, &talk())?;
    let mut desk = at_the_desk(&scene, &server)?;
    let link = desk.word_after("mon3tr call ");
    scene.knows_call(&link)?;

    let text = |path: &Path| path.display().to_string();
    let mut process = scene.process_with(&[
        ("REHEARSAL_WEARER", "allows"),
        ("REHEARSAL_MICROPHONE", &text(&microphone)),
        ("REHEARSAL_LOUDSPEAKER", &text(&loudspeaker)),
        ("REHEARSAL_SOUND_AWAY", &text(&away)),
    ])?;
    let activity = process.launch(opening_call(&link).with("name", "Ada"))?;
    process.wait_for("in the call", 1)?;
    desk.says("Ada has joined", 1);
    process.wait_for("Desk has joined", 1)?;
    shows_people(&mut process)?;
    process.wait_for("the microphone is open", 1)?;
    sleep(TALK);

    // Headphones are unplugged, and plugged in again.
    fs::write(&away, "")?;
    process.wait_for("the microphone is away", 1)?;
    process.wait_for("the loudspeaker is away", 1)?;
    let before = fs::metadata(&loudspeaker)?.len();
    shows_people(&mut process)?;
    fs::remove_file(&away)?;
    process.wait_for("the microphone is back", 1)?;
    process.wait_for("the loudspeaker is back", 1)?;
    sleep(TALK);

    let mut destruction: f64 = 0.0;
    for callback in LEAVE {
        let blocked = process.call(activity, callback)?;
        if callback == Callback::Destroy {
            destruction = blocked;
        }
    }
    ensure!(
        destruction <= DESTRUCTION_MS,
        "the main thread was blocked for {destruction:.0} ms by the destruction"
    );
    desk.says("Ada has left", 1);
    assert_well(&mut process)?;
    let sent = number_before(&process.logcat(), " frames of motion")?;
    let taken = number_before(&process.logcat(), " frames taken")?;
    process.quit()?;
    ensure!(desk.end().success(), "the one at the desk ended badly");

    let report: Value = serde_json::from_str(&fs::read_to_string(path("desk.json"))?)?;
    let seen = report["received"]["call"]["released"].as_u64().unwrap_or(0);
    ensure!(
        seen > 300 && sent > 300 && taken > 300,
        "frames of motion: {sent} sent by the app, {seen} taken at the desk; {taken} taken by the app"
    );
    let in_headset = read_raw(&loudspeaker)?;
    // Left and right, four bytes each.
    let (early, late) = in_headset.split_at(in_headset.len().min(usize::try_from(before / 8)?));
    let at_desk = read_wav(&path("heard.wav"))?;
    let (wearer, at_desk_said) = (talk(), desk_voice());
    let mut figures = Figures::new();
    for (what, heard, said, other) in [
        ("in_the_headset", early, &at_desk_said, &wearer),
        ("in_the_headset_again", late, &at_desk_said, &wearer),
        ("at_the_desk", at_desk.as_slice(), &wearer, &at_desk_said),
    ] {
        let (like, unlike) = (likeness(heard, said), likeness(heard, other));
        ensure!(
            like > LIKE && unlike < UNLIKE,
            "{what}: what was heard is like what was said by {like:.3}, like another voice by {unlike:.3}"
        );
        figure(&mut figures, what, like);
    }
    figure(&mut figures, "frames_sent", sent);
    figure(&mut figures, "frames_at_the_desk", seen);
    figure(&mut figures, "frames_taken", taken);
    figure(&mut figures, "destruction_ms", destruction);
    Ok(figures)
}

/// Without an avatar the app says what to do; a wearer who refuses the microphone is seen all the same.
pub(super) fn perform_without(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let scene = environment.scene(name, Compositor::Null)?;
    let server = scene.server(PuppetSize::SMALL)?;
    let mut desk = at_the_desk(&scene, &server)?;
    let link = desk.word_after("mon3tr call ");
    scene.knows_call(&link)?;
    let mut process = scene.process()?;
    let activity = process.launch(opening_call(&link))?;
    process.wait_for("there is no avatar", 1)?;
    shows_a_notice(&mut process)?;
    process.leave(activity)?;
    ensure!(
        !desk.said().contains("has joined"),
        "a seat was taken without an avatar"
    );

    fs::create_dir_all(scene.external())?;
    fs::copy(&server.avatar, scene.external().join("ada-2.m3a"))?;
    let intent = opening_call(&link).with("avatar", "ada-2.m3a");
    let activity = process.launch(intent.with("name", "Ada"))?;
    process.wait_for(
        "the microphone is not allowed: the call goes on without it",
        1,
    )?;
    desk.says("Ada has joined", 1);
    shows_people(&mut process)?;
    let opened = process.logged("the microphone is open");
    ensure!(opened == 0, "the microphone was opened all the same");
    process.leave(activity)?;
    desk.says("Ada has left", 1);
    assert_well(&mut process)?;
    process.quit()?;
    Ok(Figures::new())
}

/// A person at a desk, who opens the call.
fn at_the_desk(scene: &Scene<'_>, server: &Server) -> anyhow::Result<Program> {
    let path = |name: &str| scene.folder.join(name).display().to_string();
    write_wav(Path::new(&path("said.wav")), &desk_voice())?;
    let address = format!("http://{}", server.address);
    let (said, heard, report) = (path("said.wav"), path("heard.wav"), path("desk.json"));
    Ok(scene.call(
        server,
        &[
            ("--server", &address),
            ("--name", "Desk"),
            ("--display", "none"),
            ("--voice", &said),
            ("--sound", &heard),
            ("--json", &report),
        ],
    ))
}

/// How alike the best piece of what was heard is to a voice.
pub(super) fn likeness(heard: &[f32], voice: &[f32]) -> f32 {
    let said = loudness(voice);
    loudness(heard)
        .chunks_exact(PIECE)
        .map(|piece| best_likeness(&said, piece))
        .fold(f32::MIN, f32::max)
}

/// The number before these words, where the log has them last.
pub(super) fn number_before(log: &str, words: &str) -> anyhow::Result<u64> {
    let (before, _) = log
        .rsplit_once(words)
        .with_context(|| format!("the log has no `{words}`"))?;
    let number = before.rsplit(' ').next().unwrap_or_default();
    number
        .parse()
        .with_context(|| format!("{number} stands before `{words}`"))
}

pub(super) fn write_raw(path: &Path, samples: &[f32]) -> anyhow::Result<()> {
    let bytes: Vec<u8> = samples.iter().flat_map(|s| s.to_le_bytes()).collect();
    fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

pub(super) fn read_raw(path: &Path) -> anyhow::Result<Vec<f32>> {
    let bytes = fs::read(path).with_context(|| format!("no sound in {}", path.display()))?;
    let (samples, _) = bytes.as_chunks::<4>();
    let samples: Vec<f32> = samples.iter().map(|s| f32::from_le_bytes(*s)).collect();
    Ok(both_ears(&samples))
}

/// Left and right together.
fn both_ears(samples: &[f32]) -> Vec<f32> {
    let (both, _) = samples.as_chunks();
    both.iter()
        .map(|[left, right]| (left + right) / 2.0)
        .collect()
}

fn write_wav(path: &Path, samples: &[f32]) -> anyhow::Result<()> {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: u32::try_from(RATE)?,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut wav = hound::WavWriter::create(path, spec)?;
    for sample in samples {
        wav.write_sample(*sample)?;
    }
    Ok(wav.finalize()?)
}

fn read_wav(path: &Path) -> anyhow::Result<Vec<f32>> {
    let mut wav = hound::WavReader::open(path).context("nothing was heard at the desk")?;
    let samples = wav.samples::<i16>();
    let samples = samples.map(|sample| sample.map(|sample| f32::from(sample) / 32_768.0));
    Ok(both_ears(&samples.collect::<Result<Vec<_>, _>>()?))
}
