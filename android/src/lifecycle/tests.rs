use super::*;
use crate::launch::Launch;
use crate::storage::Folders;
use proptest::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;

/// Android's order of an activity's life, as its documentation draws it: which events may follow which state. Written apart from the
/// machine: from the activity's side, with the window and focus as Android nests them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Created,
    Started,
    Resumed,
    Paused,
    Stopped,
    Gone,
}

fn follow(stage: Stage) -> &'static [(Event, Stage)] {
    use Event as E;
    match stage {
        Stage::Created => &[(E::Start, Stage::Started), (E::Destroy, Stage::Gone)],
        Stage::Started => &[(E::Resume, Stage::Resumed), (E::Stop, Stage::Stopped)],
        Stage::Resumed => &[(E::Pause, Stage::Paused)],
        Stage::Paused => &[(E::Resume, Stage::Resumed), (E::Stop, Stage::Stopped)],
        Stage::Stopped => &[(E::Start, Stage::Started), (E::Destroy, Stage::Gone)],
        Stage::Gone => &[],
    }
}

/// A legal order: steps through the stages, with what may come at any time between them.
fn legal_orders() -> impl Strategy<Value = Vec<Event>> {
    prop::collection::vec((any::<bool>(), 0..6_u8), 0..40).prop_map(|choices| {
        let (mut stage, mut window, mut events) = (Stage::Created, false, Vec::new());
        for (other, aside) in choices {
            match aside {
                0 if stage != Stage::Gone => events.push(Event::LowMemory),
                1 if stage != Stage::Gone => events.push(Event::ConfigChanged),
                2 if stage != Stage::Gone => {
                    window = !window;
                    events.push(if window {
                        Event::WindowMade
                    } else {
                        Event::WindowDestroyed
                    });
                }
                3 if stage == Stage::Resumed => {
                    events.push(if other {
                        Event::FocusLost
                    } else {
                        Event::FocusGained
                    });
                }
                4 if matches!(stage, Stage::Paused | Stage::Stopped) => {
                    events.push(Event::SaveState);
                }
                _ => {
                    let next = follow(stage);
                    if let Some((event, to)) = next.get(usize::from(other)).or(next.first()) {
                        events.push(*event);
                        stage = *to;
                    }
                }
            }
        }
        events
    })
}

fn any_orders() -> impl Strategy<Value = Vec<Event>> {
    prop::collection::vec(prop::sample::select(Event::ALL.to_vec()), 0..60)
}

/// A legal order into which something illegal is put: an event repeated, left out, or moved.
fn spoiled_orders() -> impl Strategy<Value = Vec<Event>> {
    let spoil = (
        any::<prop::sample::Index>(),
        0..3_u8,
        prop::sample::select(Event::ALL.to_vec()),
    );
    (legal_orders(), prop::collection::vec(spoil, 1..4)).prop_map(|(mut events, spoils)| {
        for (at, how, event) in spoils {
            if events.is_empty() {
                events.push(event);
                continue;
            }
            let at = at.index(events.len());
            match how {
                0 => events.insert(at, events[at]),
                1 => drop(events.remove(at)),
                _ => events.insert(at, event),
            }
        }
        events
    })
}

/// The commands that a call got, counted.
#[derive(Debug, Default)]
struct Story {
    starts: u32,
    leaves: u32,
    running: bool,
}

impl Story {
    /// Refuses commands in an order that a call cannot follow.
    fn obey(&mut self, command: Command) -> Result<(), String> {
        let begun = self.starts == 1 && self.leaves == 0;
        let fits = match command {
            Command::Start => self.starts == 0 && self.leaves == 0,
            Command::Pause => begun && self.running,
            Command::Resume => begun && !self.running,
            Command::Trim(Trim::All) => begun && self.running,
            Command::Trim(Trim::HostOnly) => begun && !self.running,
            Command::Leave => begun && !self.running,
        };
        if !fits {
            return Err(format!("{command:?} after {self:?}"));
        }
        match command {
            Command::Start => (self.starts, self.running) = (1, true),
            Command::Pause => self.running = false,
            Command::Resume => self.running = true,
            Command::Leave => self.leaves = 1,
            Command::Trim(_) => {}
        }
        Ok(())
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn in_every_legal_order_the_gpu_works_exactly_while_the_activity_is_in_front(events in legal_orders()) {
        let (mut machine, mut story, mut front) = (Machine::new(), Story::default(), false);
        for event in &events {
            let step = machine.on(*event);
            prop_assert_eq!(step.oddity, None, "{:?} in {:?}", event, &events);
            for command in step.commands {
                prop_assert_eq!(story.obey(*command), Ok(()), "{:?}", &events);
            }
            match event {
                Event::Resume => front = true,
                Event::Pause | Event::Stop | Event::Destroy => front = false,
                _ => {}
            }
            prop_assert_eq!(story.running, front, "{:?} in {:?}", event, &events);
            prop_assert_eq!(machine.may_draw(), front, "{:?} in {:?}", event, &events);
        }
        let ended = events.contains(&Event::Destroy);
        prop_assert_eq!(machine.is_over(), ended, "over when destroyed");
        prop_assert_eq!(story.leaves, u32::from(ended && story.starts == 1), "every call that began is left");
    }

    #[test]
    fn in_any_order_the_call_gets_commands_that_it_can_follow(
        events in prop_oneof![any_orders(), spoiled_orders()],
    ) {
        let (mut machine, mut story) = (Machine::new(), Story::default());
        let mut destroyed = false;
        for event in &events {
            let step = machine.on(*event);
            for command in step.commands {
                prop_assert_eq!(story.obey(*command), Ok(()), "{:?}", &events);
            }
            if destroyed {
                prop_assert!(step.commands.is_empty(), "nothing after the end: {:?}", &events);
                prop_assert!(step.oddity.is_some(), "and it is reported: {:?}", &events);
            }
            destroyed |= *event == Event::Destroy;
            if matches!(event, Event::Pause | Event::Stop | Event::Destroy) {
                prop_assert!(!story.running, "{:?} in {:?}", event, &events);
            }
            prop_assert_eq!(machine.may_draw(), story.running, "{:?}", &events);
        }
        prop_assert_eq!(machine.is_over(), destroyed, "over when destroyed");
    }

    #[test]
    fn an_order_that_android_promises_not_to_send_is_reported(events in any_orders()) {
        let (mut machine, mut stage, mut window) = (Machine::new(), Stage::Created, false);
        for event in events {
            let reported = machine.on(event).oddity;
            let legal = match event {
                _ if stage == Stage::Gone => false,
                Event::WindowMade => !std::mem::replace(&mut window, true),
                Event::WindowDestroyed => std::mem::replace(&mut window, false),
                Event::Start | Event::Resume | Event::Pause | Event::Stop | Event::Destroy => {
                    let next = follow(stage).iter().find(|(next, _)| *next == event);
                    stage = next.map_or(stage, |(_, to)| *to);
                    next.is_some()
                }
                _ => true,
            };
            prop_assert_eq!(reported.is_none(), legal, "{:?}", reported);
            if !legal {
                // After the first broken promise nothing is promised.
                break;
            }
        }
    }
}

/// A GPU that counts its users, and a call with a thread that uses it all the time unless it is paused.
#[derive(Debug)]
struct Drawing {
    gpu: Arc<AtomicU64>,
    shared: Arc<(Mutex<Orders>, Condvar)>,
    thread: Option<JoinHandle<()>>,
    freed: u64,
}

#[derive(Debug, Default)]
struct Orders {
    paused: bool,
    ended: bool,
    idle: bool,
    frames: u64,
}

impl Drawing {
    fn new(gpu: &Arc<AtomicU64>) -> Self {
        Self {
            gpu: Arc::clone(gpu),
            shared: Arc::default(),
            thread: None,
            freed: 0,
        }
    }

    fn order(&self, change: impl FnOnce(&mut Orders)) {
        let (orders, bell) = &*self.shared;
        change(&mut orders.lock().expect("no panic"));
        bell.notify_all();
    }

    fn wait(&self, until: impl Fn(&Orders) -> bool) {
        let (orders, bell) = &*self.shared;
        let held = orders.lock().expect("no panic");
        drop(
            bell.wait_while(held, |orders| !until(orders))
                .expect("no panic"),
        );
    }
}

impl Receiver for Drawing {
    fn start(&mut self, _: Launch) {
        let (gpu, shared) = (Arc::clone(&self.gpu), Arc::clone(&self.shared));
        self.thread = Some(std::thread::spawn(move || {
            let (orders, bell) = &*shared;
            loop {
                let mut held = orders.lock().expect("no panic");
                while held.paused && !held.ended {
                    held.idle = true;
                    bell.notify_all();
                    held = bell.wait(held).expect("no panic");
                }
                if held.ended {
                    return;
                }
                held.idle = false;
                drop(held);
                // A frame: outside the lock, as real ones are.
                for _ in 0..20 {
                    gpu.fetch_add(1, SeqCst);
                    std::thread::yield_now();
                }
                orders.lock().expect("no panic").frames += 1;
                bell.notify_all();
            }
        }));
    }

    fn pause(&mut self) {
        self.order(|orders| orders.paused = true);
        self.wait(|orders| orders.idle);
    }

    fn resume(&mut self) {
        self.order(|orders| (orders.paused, orders.idle) = (false, false));
    }

    fn trim_memory(&mut self, what: Trim) {
        if what == Trim::All {
            self.gpu.fetch_add(1, SeqCst);
        }
        self.freed += 1;
    }

    fn leave(&mut self) {
        self.order(|orders| orders.ended = true);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("it ends");
        }
    }

    fn is_over(&self) -> bool {
        false
    }
}

fn launch() -> Launch {
    Launch::new([], None, None, Folders::new("nowhere", "nowhere"))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_thread_that_draws_all_the_time_never_touches_the_gpu_while_paused(
        events in prop_oneof![legal_orders(), spoiled_orders(), any_orders()],
    ) {
        let gpu = Arc::new(AtomicU64::new(0));
        let mut driver = Driver::new(Drawing::new(&gpu), launch());
        let mut paused_at = Some(0);
        for event in &events {
            driver.on(*event);
            let running = driver.machine.may_draw();
            match paused_at {
                Some(before) if !running => {
                    std::thread::yield_now();
                    prop_assert_eq!(gpu.load(SeqCst), before, "{:?} in {:?}", event, &events);
                }
                None if !running => paused_at = Some(gpu.load(SeqCst)),
                _ if running => {
                    paused_at = None;
                    // It does draw, so the count could have grown.
                    let frames = driver.receiver.shared.0.lock().expect("no panic").frames;
                    driver.receiver.wait(|orders| orders.frames > frames);
                }
                _ => {}
            }
        }
        driver.on(Event::Destroy);
        let before = gpu.load(SeqCst);
        std::thread::yield_now();
        prop_assert_eq!(gpu.load(SeqCst), before, "nor after the end");
        prop_assert!(driver.receiver.thread.is_none(), "the thread has ended");
    }
}

#[test]
fn a_call_goes_on_after_the_headset_was_taken_off_and_ends_with_the_activity() {
    use Event as E;
    let mut machine = Machine::new();
    let story: Vec<Command> = [
        E::Start,
        E::Resume,
        E::WindowMade,
        E::FocusGained, // in front
        E::FocusLost,
        E::FocusGained, // the system's menu, over it
        E::LowMemory,
        E::FocusLost,
        E::Pause,
        E::WindowDestroyed,
        E::SaveState,
        E::Stop, // the headset is taken off
        E::LowMemory,
        E::ConfigChanged,
        E::Start,
        E::Resume,
        E::WindowMade,
        E::FocusGained, // and put on
        E::FocusLost,
        E::Pause,
        E::WindowDestroyed,
        E::Stop,
        E::Destroy,
    ]
    .into_iter()
    .flat_map(|event| {
        let step = machine.on(event);
        assert_eq!(step.oddity, None, "{event}");
        step.commands.iter().copied()
    })
    .collect();
    assert_eq!(
        story,
        [
            Command::Start,
            Command::Trim(Trim::All),
            Command::Pause,
            Command::Trim(Trim::HostOnly),
            Command::Resume,
            Command::Pause,
            Command::Leave,
        ],
        "the whole of it"
    );
}

#[test]
fn an_oddity_is_one_line() {
    let mut machine = Machine::new();
    let odd = |machine: &mut Machine, event| {
        let reported = machine.on(event).oddity.expect("odd").to_string();
        assert!(!reported.contains('\n'), "{reported}");
        reported
    };
    assert_eq!(
        odd(&mut machine, Event::Pause),
        "Android says `pause` to an activity that was not started",
        "a pause before all"
    );
    machine.on(Event::Destroy);
    assert_eq!(
        odd(&mut machine, Event::Resume),
        "Android says `resume` to an activity that is destroyed",
        "a resume after all"
    );
}
