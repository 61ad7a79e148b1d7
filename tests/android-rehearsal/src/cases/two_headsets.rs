//! Two headsets in one call, and nobody else: each wearer is captured, sees the other move, and hears what they say.

use super::call::shows_people;
use super::member::{
    AVATAR, LIKE, UNLIKE, desk_voice, likeness, number_before, read_raw, write_raw,
};
use super::{Figures, assert_well, figure};
use crate::environment::{Environment, Scene, Server, opening_call};
use crate::process::Process;
use android_rehearsal::protocol::ActivityIndex;
use anyhow::ensure;
use std::fs;
use std::path::PathBuf;
use std::thread::sleep;
use std::time::Duration;
use synthetic_person::PuppetSize;
use test_support::monado::Compositor;
use test_support::speech::talk;

/// How long they talk: several of the pieces that are compared.
const TALK: Duration = Duration::from_secs(15);

/// One of the two.
struct Wearer<'a> {
    scene: Scene<'a>,
    process: Process,
    activity: ActivityIndex,
    said: Vec<f32>,
    heard: PathBuf,
}

impl<'a> Wearer<'a> {
    /// Opens the call's link in an app of its own, with this microphone.
    fn open(
        scene: Scene<'a>,
        server: &Server,
        link: &str,
        name: &str,
        said: Vec<f32>,
    ) -> anyhow::Result<Self> {
        fs::create_dir_all(scene.external())?;
        fs::copy(&server.avatar, scene.external().join(AVATAR))?;
        scene.knows_call(link)?;
        let [microphone, heard] = ["said.f32", "heard.f32"].map(|file| scene.folder.join(file));
        write_raw(&microphone, &said)?;
        let text = |path: &PathBuf| path.display().to_string();
        let mut process = scene.process_with(&[
            ("REHEARSAL_WEARER", "allows"),
            ("REHEARSAL_MICROPHONE", &text(&microphone)),
            ("REHEARSAL_LOUDSPEAKER", &text(&heard)),
        ])?;
        let activity = process.launch(opening_call(link).with("name", name))?;
        process.wait_for("in the call", 1)?;
        Ok(Self {
            scene,
            process,
            activity,
            said,
            heard,
        })
    }
}

pub(super) fn perform(environment: &Environment, name: &str) -> anyhow::Result<Figures> {
    let first = environment.scene(name, Compositor::Null)?;
    let second = environment.scene(&format!("{name}-second"), Compositor::Null)?;
    let server = first.server(PuppetSize::SMALL)?;
    let address = format!("http://{}", server.address);
    // A link is made at a desk, and sent to both; whoever made it leaves.
    let opened = [
        ("--server", address.as_str()),
        ("--name", "Desk"),
        ("--display", "none"),
    ];
    let mut desk = first.call(&server, &opened);
    let link = desk.word_after("mon3tr call ");
    let mut ada = Wearer::open(first, &server, &link, "Ada", talk())?;
    let mut bob = Wearer::open(second, &server, &link, "Bob", desk_voice())?;
    ada.process.wait_for("Bob has joined", 1)?;
    bob.process.wait_for("Ada has joined", 1)?;
    ensure!(desk.end().success(), "the one at the desk ended badly");
    ada.process.wait_for("Desk has left", 1)?;
    bob.process.wait_for("Desk has left", 1)?;
    for wearer in [&mut ada, &mut bob] {
        wearer.process.wait_for("the microphone is open", 1)?;
        shows_people(&mut wearer.process)?;
    }
    sleep(TALK);
    let mut figures = Figures::new();
    for (name, other, wearer) in [("Bob", "Ada", &mut bob), ("Ada", "Bob", &mut ada)] {
        if name == "Ada" {
            wearer.process.wait_for("Bob has left", 1)?;
        }
        wearer.process.leave(wearer.activity)?;
        assert_well(&mut wearer.process)?;
        let log = wearer.process.logcat();
        // Of the other wearer; of whoever was at the desk there are fewer.
        let calls = log.lines().filter(|line| line.contains(" frames taken"));
        let taken = calls.map(|line| number_before(line, " frames taken"));
        let taken = taken.collect::<anyhow::Result<Vec<_>>>()?;
        let taken = taken.into_iter().max().unwrap_or(0);
        ensure!(taken > 200, "{name} has taken {taken} frames of {other}");
        figure(&mut figures, &format!("frames_taken_by_{name}"), taken);
    }
    for (name, wearer, said) in [("Ada", &ada, &bob.said), ("Bob", &bob, &ada.said)] {
        let heard = read_raw(&wearer.heard)?;
        let (like, unlike) = (likeness(&heard, said), likeness(&heard, &wearer.said));
        ensure!(
            like > LIKE && unlike < UNLIKE,
            "{name}: what was heard is like what the other said by {like:.3}, like what they said themselves by {unlike:.3}; the files are in {}",
            wearer.scene.folder.display()
        );
        figure(&mut figures, &format!("heard_by_{name}"), like);
    }
    ada.process.quit()?;
    bob.process.quit()?;
    Ok(figures)
}
