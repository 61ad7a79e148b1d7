//! What Android's scheduler is told of pictures: which threads make them, how long they have, and how long they took. From that it chooses
//! clocks and cores, rather than from how busy cores were.

use std::time::Duration;

use crate::native::{Session, System};

/// Tells of one picture after the other.
#[derive(Debug)]
pub struct PictureHints {
    system: System,
    session: Option<Session>,
    target: Duration,
    /// The platform refused: it is not asked again until threads change.
    refused: bool,
}

impl PictureHints {
    /// For pictures of which none is made yet. Does nothing where the platform takes no hints.
    #[must_use]
    pub fn new(system: System) -> Self {
        Self {
            system,
            session: None,
            target: Duration::ZERO,
            refused: false,
        }
    }

    /// Other threads make pictures from now on.
    pub fn threads_changed(&mut self) {
        self.session = None;
        self.refused = false;
    }

    /// A picture took the threads `worked` of the `period` that there is for each. `threads` are the kernel's numbers of these threads; it is
    /// called for the first picture only, and after [`Self::threads_changed`].
    pub fn picture(
        &mut self,
        period: Duration,
        worked: Duration,
        threads: impl FnOnce() -> Vec<i32>,
    ) {
        let Some(functions) = self.system.hints.filter(|_| !self.refused) else {
            return;
        };
        if self.session.is_none() {
            let threads = threads();
            self.session = Session::create(functions, &threads, period);
            self.target = period;
            if self.session.is_some() {
                let milliseconds = period.as_secs_f64() * 1e3;
                log::info!(
                    "Android is told of {} threads' pictures, each within {milliseconds:.1} ms",
                    threads.len()
                );
            }
        }
        let Some(session) = &self.session else {
            return self.refuse("no session");
        };
        let told = if period == self.target {
            Ok(())
        } else {
            self.target = period;
            session.update_target(period)
        };
        if let Err(errno) = told.and_then(|()| session.report_actual(worked)) {
            self.refuse(&format!("error {errno}"));
        }
    }

    fn refuse(&mut self, why: &str) {
        log::debug!("Android takes no hints of pictures: {why}");
        self.session = None;
        self.refused = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{self, Hint};

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_session_is_opened_with_the_first_picture_told_of_each_and_closed_at_the_end() {
        let _here = fake::alone();
        let mut hints = PictureHints::new(fake::system());
        assert!(fake::hints().is_empty(), "no picture yet");
        hints.picture(14 * MS, 5 * MS, || vec![11, 12]);
        hints.picture(14 * MS, 6 * MS, || unreachable!("asked for once"));
        hints.picture(11 * MS, Duration::ZERO, || unreachable!("asked for once"));
        let ms = 1_000_000;
        assert_eq!(
            fake::hints(),
            [
                Hint::Created(vec![11, 12], 14 * ms),
                Hint::Reported(5 * ms),
                Hint::Reported(6 * ms),
                Hint::Target(11 * ms),
                // No picture is made in no time.
                Hint::Reported(1),
            ],
            "told"
        );
        hints.threads_changed();
        assert_eq!(fake::hints(), [Hint::Closed], "closed");
        hints.picture(11 * MS, MS, || vec![12]);
        drop(hints);
        let expected = [
            Hint::Created(vec![12], 11 * ms),
            Hint::Reported(ms),
            Hint::Closed,
        ];
        assert_eq!(fake::hints(), expected, "another");
    }

    #[test]
    fn where_the_platform_refuses_it_is_not_asked_for_each_picture() {
        let _here = fake::alone();
        fake::set(|fake| fake.gives_sessions = false);
        let mut hints = PictureHints::new(fake::system());
        let mut asked = 0;
        for _ in 0..3 {
            hints.picture(MS, MS, || {
                asked += 1;
                vec![1]
            });
        }
        assert_eq!(asked, 1, "once");
        fake::set(|fake| fake.gives_sessions = true);
        hints.threads_changed();
        // A broken pipe to the system's service.
        fake::set(|fake| fake.errno = 32);
        hints.picture(MS, MS, || vec![1]);
        hints.picture(MS, MS, || vec![1]);
        let expected = [
            Hint::Created(vec![1], 1_000_000),
            Hint::Reported(1_000_000),
            Hint::Closed,
        ];
        assert_eq!(fake::hints(), expected, "closed after the error");
    }

    #[test]
    fn a_system_without_hints_is_told_nothing() {
        let _here = fake::alone();
        let mut hints = PictureHints::new(System::default());
        hints.picture(MS, MS, || unreachable!("nobody wants to know"));
        let mut system = fake::system();
        system.hints = None;
        PictureHints::new(system).picture(MS, MS, || unreachable!("nor here"));
        fake::set(|fake| fake.gives_managers = false);
        PictureHints::new(fake::system()).picture(MS, MS, || vec![1]);
        assert!(fake::hints().is_empty(), "nothing is told");
    }
}
