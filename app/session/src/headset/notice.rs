//! A notice in the headset while there are no people to see yet: which sender is waited for, what is being fetched, what is missing.

use super::frames::IDLE;
use super::handle::{HeadsetHandle, close};
use super::hanging::{Spot, image};
use crate::display::SessionError;
use crate::overlay::{NOTICE_WIDTH_METRES, Notice, Panel};
use app_pipeline::control::Control;
use glam::Affine3A;
use renderer_openxr::error::XrError;
use renderer_openxr::frame::Frame;
use renderer_openxr::session::{Session, SessionEnd, SessionOptions};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The viewer answers yes by holding for so long: nobody does that by accident.
const HELD_FOR: Duration = Duration::from_secs(1);

/// Where a notice is written by one thread, and read by the headset's. Copies are the same one.
#[derive(Debug, Clone, Default)]
pub struct NoticeBoard(Arc<Mutex<Board>>);

#[derive(Debug, Default)]
struct Board {
    notice: Notice,
    question: Question,
}

/// Whether the viewer is asked something.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Question {
    #[default]
    None,
    Asked,
    Yes,
}

impl NoticeBoard {
    /// Shows this from now on.
    pub fn write(&self, notice: Notice) {
        let question = Question::None;
        *self.lock() = Board { notice, question };
    }

    /// Shows this from now on, and waits for the viewer to hold with either hand (squeeze, select, or pinch) for a second.
    pub fn ask(&self, notice: Notice) {
        let question = Question::Asked;
        *self.lock() = Board { notice, question };
    }

    /// Whether they have done so.
    #[must_use]
    pub fn is_answered(&self) -> bool {
        self.lock().question == Question::Yes
    }

    /// What is to be shown now.
    #[must_use]
    pub fn read(&self) -> Notice {
        self.lock().notice.clone()
    }

    fn lock(&self) -> MutexGuard<'_, Board> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How long a hand has held. What it held before the question was there does not count.
#[derive(Debug, Default)]
struct Hold {
    was_open: bool,
    since: Option<Instant>,
}

impl Hold {
    /// Whether it is long enough now.
    fn step(&mut self, holds: bool, now: Instant) -> bool {
        if !holds {
            *self = Self {
                was_open: true,
                since: None,
            };
            return false;
        }
        self.was_open && now.duration_since(*self.since.get_or_insert(now)) >= HELD_FOR
    }
}

/// Shows what is on the board until `is_over`, or the viewer closes the program from the headset's own menu. When the headset goes
/// away it is waited for. It is closed at the end.
///
/// # Errors
/// If the headset cannot be shown anything.
pub fn show_notice(
    found: HeadsetHandle,
    board: &NoticeBoard,
    control: &Control,
    is_over: impl Fn() -> bool,
) -> Result<(), SessionError> {
    let is_over = || is_over() || control.is_leaving();
    let mut present = Some(found);
    let mut outcome = Ok(());
    while let Some(found) = present.take_if(|_| control.begin_work()) {
        let session = until_over(&found, board, control, &is_over);
        control.end_work();
        match session {
            Ok(Some(SessionEnd::Lost)) => log::warn!("the headset is gone; waiting for it"),
            Err(SessionError::Headset(error)) if error.is_loss() => {
                log::warn!("{error}; waiting for it");
            }
            ended => {
                outcome = ended.map(|_| ());
                present = Some(found);
                break;
            }
        }
        present = found.open_again(control, &is_over);
    }
    close(present, control);
    outcome
}

/// One session; nothing if `is_over` ended it.
fn until_over(
    found: &HeadsetHandle,
    board: &NoticeBoard,
    control: &Control,
    is_over: &dyn Fn() -> bool,
) -> Result<Option<SessionEnd>, SessionError> {
    let options = SessionOptions {
        room: true,
        read_back: false,
        display_hz: None,
    };
    let mut session = Session::new(found.headset(), options)?;
    let mut shown = Shown::default();
    while !is_over() {
        let happened = session.poll()?;
        if happened.recentred {
            shown.floor_from_panel = None;
        }
        if happened.end.is_some() {
            return Ok(happened.end);
        }
        let pauses = !control.may_work();
        if pauses {
            session.wait_idle()?;
            control.end_work();
        }
        if pauses || !session.lifecycle().is_running() {
            std::thread::sleep(IDLE);
            continue;
        }
        shown.frame(&mut session, board)?;
    }
    Ok(None)
}

/// What hangs there.
#[derive(Debug, Default)]
struct Shown {
    notice: Option<Notice>,
    panel: Option<Panel>,
    floor_from_panel: Option<Affine3A>,
    hands: [Hold; 2],
}

impl Shown {
    /// Looks for the answer to a question.
    fn listen(
        &mut self,
        session: &mut Session,
        frame: &Frame,
        board: &NoticeBoard,
    ) -> Result<(), XrError> {
        if board.lock().question != Question::Asked {
            self.hands = Default::default();
            return Ok(());
        }
        let (controls, now) = (session.controls(frame)?, Instant::now());
        let mut is_yes = false;
        for (hand, seen) in self.hands.iter_mut().zip(controls.hands) {
            is_yes |= hand.step(seen.holds, now);
        }
        let mut board = board.lock();
        if is_yes && board.question == Question::Asked {
            board.question = Question::Yes;
        }
        Ok(())
    }

    fn frame(&mut self, session: &mut Session, board: &NoticeBoard) -> Result<(), XrError> {
        let frame = session.wait()?;
        let eyes = if frame.should_render {
            session.locate_views(&frame)?
        } else {
            None
        };
        let Some(eyes) = eyes else {
            return session.skip(frame);
        };
        self.listen(session, &frame, board)?;
        let hung = self.floor_from_panel.is_some();
        let place = *self
            .floor_from_panel
            .get_or_insert_with(|| Spot::AHEAD.before(eyes.floor_from_head));
        let notice = board.read();
        if !hung || self.notice.as_ref() != Some(&notice) {
            let panel = self.panel.insert(notice.panel());
            self.notice = Some(notice);
            let hung = session.hang_panel(image(panel), place, NOTICE_WIDTH_METRES);
            if let Err(error) = hung {
                // What went wrong first is told.
                let _ = session.skip(frame);
                return Err(error);
            }
        }
        session.show_panel(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_of_holding_answers_and_what_was_held_before_does_not() {
        let begun = Instant::now();
        let at = |ms| begun + Duration::from_millis(ms);
        let mut hand = Hold::default();
        assert!(!hand.step(true, at(0)), "held before");
        assert!(!hand.step(true, at(5000)), "and still");
        assert!(!hand.step(false, at(5010)));
        assert!(!hand.step(true, at(5020)), "begun");
        assert!(!hand.step(true, at(5900)), "not long enough");
        assert!(!hand.step(false, at(5910)), "let go");
        assert!(!hand.step(true, at(6100)));
        assert!(hand.step(true, at(7100)), "a second");
    }

    #[test]
    fn a_question_is_answered_once_and_a_notice_asks_nothing() {
        let board = NoticeBoard::default();
        board.ask(Notice::default());
        assert!(!board.is_answered());
        board.lock().question = Question::Yes;
        assert!(board.is_answered());
        board.write(Notice::default());
        assert!(!board.is_answered(), "another notice");
    }
}
