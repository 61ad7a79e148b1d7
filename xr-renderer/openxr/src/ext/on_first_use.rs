//! An extension's object that is made when it is first used. Who never uses it never makes it: some cost power, and ask the wearer for leave.

use std::time::{Duration, Instant};

use super::Absent;

/// A runtime that refuses is asked again after this: the wearer may have given leave since.
const AGAIN: Duration = Duration::from_secs(3);

/// The object, once it was made.
#[derive(Debug)]
pub(crate) struct OnFirstUse<T> {
    what: &'static str,
    state: State<T>,
    told: bool,
}

#[derive(Debug)]
enum State<T> {
    /// Not made yet; not before then, if a time is named.
    Open(Option<Instant>),
    Made(T),
    /// The runtime or the headset has none.
    Never,
}

impl<T> OnFirstUse<T> {
    /// An object that is not made yet. `what` names it in the log.
    pub(crate) fn new(what: &'static str) -> Self {
        Self {
            what,
            state: State::Open(None),
            told: false,
        }
    }

    /// What `read` gets from the object, which `make` makes where there is none yet; nothing where either fails. The first failure is logged.
    pub(crate) fn read<R>(
        &mut self,
        now: Instant,
        make: impl FnOnce() -> Result<T, Absent>,
        read: impl FnOnce(&mut T) -> Result<Option<R>, Absent>,
    ) -> Option<R> {
        if let State::Open(not_before) = self.state {
            if not_before.is_some_and(|time| now < time) {
                return None;
            }
            self.state = match make() {
                Ok(made) => State::Made(made),
                Err(why) => {
                    self.tell(why);
                    match why {
                        Absent::Refused { .. } => State::Open(Some(now + AGAIN)),
                        _ => State::Never,
                    }
                }
            };
        }
        let State::Made(made) = &mut self.state else {
            return None;
        };
        match read(made) {
            Ok(found) => found,
            Err(why) => {
                self.tell(why);
                None
            }
        }
    }

    fn tell(&mut self, why: Absent) {
        if !std::mem::replace(&mut self.told, true) {
            log::info!("without {}: {why}", self.what);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use openxr::sys;

    const REFUSED: Absent = Absent::Refused {
        call: "xrCreateSomething",
        result: sys::Result::ERROR_RUNTIME_FAILURE,
    };

    #[test]
    fn it_is_made_once_and_a_refusal_is_tried_again_later() {
        let (mut thing, start) = (OnFirstUse::<u32>::new("a thing"), Instant::now());
        let mut tries = 0;
        let mut read = |seconds: f32, made: Result<u32, Absent>| {
            let now = start + Duration::from_secs_f32(seconds);
            let make = || {
                tries += 1;
                made
            };
            thing.read(now, make, |thing| Ok(Some(*thing)))
        };
        assert_eq!(read(0.0, Err(REFUSED)), None, "refused");
        assert_eq!(read(1.0, Ok(5)), None, "not asked again so soon");
        assert_eq!(read(3.5, Ok(6)), Some(6), "asked again");
        assert_eq!(read(9.0, Ok(7)), Some(6), "kept");
        assert_eq!(tries, 2, "made");
    }

    #[test]
    fn what_the_headset_lacks_is_not_asked_for_again() {
        let mut thing = OnFirstUse::<u32>::new("a thing");
        let now = Instant::now();
        let none = thing.read(now, || Err(Absent::NotBySystem("XR_X")), |_| Ok(Some(1)));
        assert_eq!(none, None, "absent");
        let later = now + Duration::from_secs(60);
        let made = || panic!("the headset has none");
        assert_eq!(thing.read(later, made, |_| Ok(Some(1))), None, "never");
    }

    #[test]
    fn a_failed_read_is_nothing_and_the_object_stays() {
        let mut thing = OnFirstUse::<u32>::new("a thing");
        let now = Instant::now();
        let failed: Option<u32> = thing.read(now, || Ok(1), |_| Err(REFUSED));
        assert_eq!(failed, None, "nothing");
        let made = || panic!("it is there");
        assert_eq!(
            thing.read(now, made, |thing| Ok(Some(*thing))),
            Some(1),
            "kept"
        );
    }
}
