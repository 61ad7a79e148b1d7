//! The buttons of a headset by which its wearer is heard and seen, or not.

use app_session::headset::PrivacySwitch;
use app_session::overlay::Notice;
use link_call::Privacy;
use link_protocol::data_channel::PersonState;

/// The wearer's own privacy, at their buttons.
#[derive(Debug, Clone)]
pub struct PrivacyButtons(Privacy);

impl PrivacyButtons {
    /// Of the one who is sent with this.
    #[must_use]
    pub fn new(privacy: Privacy) -> Self {
        Self(privacy)
    }
}

impl PrivacySwitch for PrivacyButtons {
    fn toggle_mute(&self) {
        tell(self.0.toggle_mute());
    }

    fn toggle_hide(&self) {
        tell(self.0.toggle_hide());
    }

    fn notice(&self) -> Option<Notice> {
        let PersonState { muted, hidden } = self.0.state();
        let title = match (muted, hidden) {
            (false, false) => return None,
            (true, false) => "The others do not hear you",
            (false, true) => "The others do not see you",
            (true, true) => "The others neither hear nor see you",
        };
        let mut lines = Vec::new();
        if muted {
            lines.push("To be heard: A, or right thumb and middle finger".to_owned());
        }
        if hidden {
            lines.push("To be seen: B".to_owned());
        }
        Some(Notice {
            title: title.to_owned(),
            lines,
        })
    }
}

fn tell(PersonState { muted, hidden }: PersonState) {
    let [heard, seen] = [muted, hidden].map(|not| if not { "not " } else { "" });
    log::info!("you are {heard}heard and {seen}seen");
}

#[cfg(test)]
mod tests {
    use super::*;
    use app_session::overlay::{NOTICE_LETTERS, NOTICE_LINES};

    #[test]
    fn a_notice_hangs_while_one_is_not_heard_or_not_seen_and_fits() {
        let privacy = Privacy::default();
        let buttons = PrivacyButtons::new(privacy.clone());
        assert_eq!(buttons.notice(), None);
        buttons.toggle_mute();
        assert!(privacy.state().muted, "it is what is sent");
        let muted = buttons.notice().expect("muted");
        buttons.toggle_hide();
        let both = buttons.notice().expect("muted and hidden");
        assert!(muted != both && both.lines.len() <= NOTICE_LINES);
        let letters = both.lines.iter().map(|line| line.chars().count());
        assert!(
            letters
                .max()
                .is_some_and(|most| most <= NOTICE_LETTERS as usize)
        );
        buttons.toggle_mute();
        buttons.toggle_hide();
        assert_eq!(buttons.notice(), None);
    }
}
