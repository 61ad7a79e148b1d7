//! What a person before a camera should know: nobody is seen, it is dark, there are several people.

use std::fmt;
use tracker::source::Picture;

/// For so long it must be so before it is said, seconds.
const PATIENCE: f64 = 1.0;
/// Mean brightness of a dark picture, 0..=255.
const DARK: u64 = 18;
/// Of so many pixels one is looked at for the brightness.
const SPARSE: usize = 97;

/// What is the matter with the pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Notice {
    Nobody,
    Dark,
    Several(usize),
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nobody => f.write_str(
                "there is no person in the picture: the avatar waits at rest (move until head and shoulders are seen)",
            ),
            Self::Dark => f.write_str(
                "the picture is dark, and no person is seen in it: uncover the camera, or make light",
            ),
            Self::Several(people) => {
                write!(f, "{people} people are in the picture: the nearest one is followed")
            }
        }
    }
}

impl Notice {
    /// In two words.
    pub(crate) fn short(self) -> String {
        match self {
            Self::Nobody => "no person".to_owned(),
            Self::Dark => "dark".to_owned(),
            Self::Several(people) => format!("{people} people"),
        }
    }
}

/// Says each thing once, when it has lasted.
#[derive(Debug, Default)]
pub(crate) struct Notices {
    /// What may be said, and since when it is so, seconds.
    waiting: Option<(Notice, f64)>,
    said: Option<Notice>,
}

impl Notices {
    /// What was said last and is still so.
    pub(crate) fn now(&self) -> Option<Notice> {
        self.said
    }

    /// What is new to be said after a picture.
    pub(crate) fn after(
        &mut self,
        picture: &Picture,
        sees_person: bool,
        people: Option<usize>,
    ) -> Option<Notice> {
        let now = match (sees_person, people) {
            (false, _) if is_dark(&picture.rgb) => Some(Notice::Dark),
            (false, _) => Some(Notice::Nobody),
            (true, Some(people)) if people > 1 => Some(Notice::Several(people)),
            (true, _) => None,
        };
        let Some(now) = now else {
            (self.waiting, self.said) = (None, None);
            return None;
        };
        let since = match self.waiting {
            Some((waiting, since)) if waiting == now => since,
            _ => picture.seconds,
        };
        self.waiting = Some((now, since));
        let is_due = picture.seconds - since >= PATIENCE && self.said != Some(now);
        is_due.then(|| *self.said.insert(now))
    }
}

fn is_dark(rgb: &[u8]) -> bool {
    let some = rgb.iter().step_by(3 * SPARSE + 1);
    let (sum, count) = some.fold((0u64, 0u64), |(sum, count), v| {
        (sum + u64::from(*v), count + 1)
    });
    sum < DARK * count
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(seconds: f64, value: u8) -> Picture {
        Picture {
            width: 64,
            height: 48,
            rgb: vec![value; 64 * 48 * 3],
            seconds,
            ..Picture::empty()
        }
    }

    #[test]
    fn each_thing_is_said_once_when_it_has_lasted() {
        let mut notices = Notices::default();
        let mut said = Vec::new();
        for k in 0..90 {
            let seconds = f64::from(k) / 30.0;
            said.extend(notices.after(&picture(seconds, 90), false, None));
        }
        assert_eq!(said, [Notice::Nobody]);
        assert_eq!(notices.after(&picture(3.0, 90), true, Some(1)), None);
        for k in 0..60 {
            let seconds = 3.0 + f64::from(k) / 30.0;
            said.extend(notices.after(&picture(seconds, 3), false, None));
        }
        assert_eq!(said, [Notice::Nobody, Notice::Dark]);
        for k in 0..60 {
            let seconds = 5.0 + f64::from(k) / 30.0;
            said.extend(notices.after(&picture(seconds, 90), true, Some(2)));
        }
        assert_eq!(said[2..], [Notice::Several(2)]);
    }
}
