//! Calls between homes behind NAT: which way each kind of pair takes, and that a change of address ends no call.

use crate::house::{count, longest_gap};
use serde_json::Value;
use std::path::Path;
use std::time::Duration;
use test_support::internet::{CallWorld, Home, HomeKind, Receiving, Sending};
use test_support::service::LONGEST_WAIT;

/// Pairs that call at the same time: more would keep a small machine from checking a path in its time.
const AT_ONCE: usize = 3;

fn world() -> Option<CallWorld> {
    CallWorld::open(Path::new(crate::PROGRAM))
}

fn two(world: &mut CallWorld, kind: HomeKind) -> [Home; 2] {
    [(); 2].map(|()| world.internet().home(kind))
}

/// The way that a call takes.
#[derive(Debug, PartialEq, Eq)]
enum Way {
    Direct,
    Relayed,
}

/// As it has to be: NATs of which one gives every address another port, and the other lets in only whom it knows, cannot be opened to each
/// other, and without UDP there is nothing but the relay.
fn way(a: HomeKind, b: HomeKind) -> Way {
    use HomeKind::{Cone, Open, Symmetric, UdpBlocked};
    match [a, b] {
        [UdpBlocked, _] | [_, UdpBlocked] => Way::Relayed,
        [Open, _] | [_, Open] | [Cone, Cone] => Way::Direct,
        [Symmetric, _] | [_, Symmetric] => Way::Relayed,
    }
}

/// That one side's path is the one for such a pair, in figures and in the line that was said.
fn assert_path(path: &Value, line: &str, own: HomeKind, other: HomeKind) {
    let told = format!("{own} to {other}: {path:#}, {line}");
    let relayed = ["local", "remote"].map(|end| path[end]["kind"] == "relay");
    let taken = match relayed.contains(&true) {
        true => Way::Relayed,
        false => Way::Direct,
    };
    assert_eq!(taken, way(own, other), "{told}");
    let words = match taken {
        Way::Direct => "direct",
        Way::Relayed => "relayed by",
    };
    assert!(line.starts_with(words), "{told}");
    if own == HomeKind::UdpBlocked {
        assert_eq!(path["relay"]["transport"], "tcp", "{told}");
        assert!(line.contains("over TCP"), "{told}");
    } else {
        // By its own relay, or by the other side's.
        assert_ne!(path["relay"]["transport"], "tcp", "{told}");
        assert!(line.contains("UDP"), "{told}");
    }
}

/// What a program said of its way.
fn line_of(said: &str, joined: &str) -> String {
    let line = said.lines().find(|line| line.contains(joined));
    let line = line.unwrap_or_else(|| panic!("no `{joined}` in:\n{said}"));
    let way = line.split_once("): ").map(|(_, way)| way.to_owned());
    way.unwrap_or_else(|| panic!("no way in `{line}`"))
}

/// The figures of a viewer whose call is over.
fn ended(receiving: &mut Receiving) -> Value {
    match receiving.outcome(LONGEST_WAIT) {
        Some(Ok(call)) => call,
        Some(Err(why)) => panic!("{why}"),
        None => panic!("it does not end:\n{}", receiving.program.said()),
    }
}

/// A call of two seconds.
struct Call {
    sending: Sending,
    receiving: Receiving,
    kinds: [HomeKind; 2],
}

impl Call {
    fn begin(world: &CallWorld, from: &Home, to: &Home) -> Self {
        let sending = world.send(from, &["--seconds", "2"]);
        let receiving = world.receive(to, &sending.link, &[]);
        let kinds = [from.kind(), to.kind()];
        Self {
            sending,
            receiving,
            kinds,
        }
    }

    fn assert_it_took_its_way(mut self) {
        let [from, to] = self.kinds;
        let Some(Ok(sent)) = self.sending.outcome(LONGEST_WAIT) else {
            let said = [&self.sending.program, &self.receiving.program].map(|it| it.said());
            panic!("{from} to {to}:\n{}\n{}", said[0], said[1]);
        };
        // It ends when the sender hangs up.
        let received = ended(&mut self.receiving);
        let line = line_of(&self.receiving.program.said(), "joined (session");
        assert_path(&received["received"]["path"], &line, to, from);
        let line = line_of(&self.sending.program.said(), "a viewer has joined");
        assert_path(&sent["paths"][0], &line, from, to);
        assert!(
            count(&received, "released") > 0,
            "{from} to {to}: no motion came: {received:#}"
        );
    }
}

#[test]
fn homes_of_every_kind_call_each_other_by_the_best_way_there_is() {
    let Some(mut world) = world() else { return };
    let homes = HomeKind::ALL.map(|kind| two(&mut world, kind));
    let pairs: Vec<_> = (0..homes.len())
        .flat_map(|from| (from..homes.len()).map(move |to| (from, to)))
        .collect();
    for some in pairs.chunks(AT_ONCE) {
        let begin =
            |&(from, to): &(usize, usize)| Call::begin(&world, &homes[from][0], &homes[to][1]);
        let calls: Vec<_> = some.iter().map(begin).collect();
        for call in calls {
            call.assert_it_took_its_way();
        }
    }
}

#[test]
fn ten_viewers_behind_a_symmetric_nat_see_one_sender_behind_another() {
    let Some(mut world) = world() else { return };
    let [here, there] = two(&mut world, HomeKind::Symmetric);
    let mut sending = world.send(&here, &[]);
    let mut viewers = [(); 10].map(|()| world.receive(&there, &sending.link, &[]));
    for viewer in &mut viewers {
        viewer.program.says("joined (session", 1);
    }
    sending.program.says("a viewer has joined", viewers.len());
    std::thread::sleep(Duration::from_secs(1));
    let sent = sending.hang_up();
    assert_eq!(count(&sent, "joined"), 10, "each of them once: {sent:#}");
    for mut viewer in viewers {
        let call = ended(&mut viewer);
        assert!(count(&call, "released") > 0, "no motion came: {call:#}");
        let line = line_of(&viewer.program.said(), "joined (session");
        assert_path(&call["received"]["path"], &line, there.kind(), here.kind());
    }
}

/// A call whose one end moves in the middle of it. Returns what the sender said, where there could be one.
fn call_through(kinds: [HomeKind; 2], moves: impl FnOnce(&mut [Home; 2])) -> Option<String> {
    let mut world = world()?;
    let mut homes = kinds.map(|kind| world.internet().home(kind));
    let mut sending = world.send(&homes[0], &[]);
    let mut receiving = world.receive(&homes[1], &sending.link, &[]);
    receiving.program.says("joined (session", 1);
    sending.program.says("a viewer has joined", 1);
    // Some motion first, of which the gap is then told.
    std::thread::sleep(Duration::from_secs(1));
    moves(&mut homes);
    receiving.program.says("joined (session", 2);
    std::thread::sleep(Duration::from_secs(1));
    sending.hang_up();
    let call = ended(&mut receiving);
    assert!(
        longest_gap(&call).is_some(),
        "motion comes again after a gap: {call:#}"
    );
    Some(sending.program.said())
}

#[test]
fn a_call_goes_on_when_the_viewers_machine_gets_another_address() {
    call_through([HomeKind::Cone; 2], |[_, viewer]| viewer.move_machine());
}

#[test]
fn a_call_goes_on_when_the_senders_machine_gets_another_address() {
    call_through([HomeKind::Cone; 2], |[sender, _]| sender.move_machine());
}

#[test]
fn a_call_goes_on_when_the_viewers_router_gets_another_address() {
    call_through([HomeKind::Symmetric; 2], |[_, viewer]| viewer.move_router());
}

#[test]
fn a_call_goes_on_when_the_senders_router_gets_another_address() {
    let said = call_through([HomeKind::Cone; 2], |[sender, _]| sender.move_router());
    // Its own addresses are as they were; without, the viewer's offer would be heard when the server's silence is noticed.
    let silent = "viewers are silent: entering the room again";
    assert!(said.is_none_or(|said| said.contains(silent)), "{silent}");
}

#[test]
fn a_call_over_tcp_goes_on_when_the_viewers_machine_gets_another_address() {
    call_through([HomeKind::UdpBlocked; 2], |[_, viewer]| {
        viewer.move_machine();
    });
}

#[test]
fn the_doctor_tells_what_is_between_a_home_and_the_others() {
    let Some(mut world) = world() else { return };
    for (kind, between, verdict) in [
        (HomeKind::Open, "nothing", "Others reach you directly."),
        (
            HomeKind::Cone,
            "cone",
            "where their own NAT allows it, else by the relay",
        ),
        (HomeKind::Symmetric, "symmetric", "by the relay at worst"),
        (HomeKind::UdpBlocked, "no_udp", "by the relay only"),
    ] {
        let home = world.internet().home(kind);
        let (figures, said) = world.doctor(&home);
        println!("{kind}:\n{said}");
        assert_eq!(figures["between"], between, "{kind}: {figures:#}");
        assert_eq!(figures["is_lent"], true, "{kind}: {figures:#}");
        assert!(said.contains(verdict), "{kind}: {said}");
        let transport = &figures["relay"]["transport"];
        let expected = if kind == HomeKind::UdpBlocked {
            "tcp"
        } else {
            "udp"
        };
        assert_eq!(transport, expected, "{kind}: {figures:#}");
    }
}
