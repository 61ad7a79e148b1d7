//! A panel of plain text: what the viewer in a headset reads before there is a person to see.

use super::glyphs::{Glyphs, TextSize};
use super::layout::{BRIGHT, DIM, Item, Rect, Shape, line_height};
use super::panel::{CARD, Panel, card};

/// Letters of the longest line; the rest of a longer one is cut off.
pub const NOTICE_LETTERS: u32 = 60;
/// Lines below the title; more are left out.
pub const NOTICE_LINES: usize = 24;
/// Width of a notice in the room, metres: letters as large as those of the panel of figures.
pub const NOTICE_WIDTH_METRES: f32 = 0.66;

const WIDTH: u32 = 2 * MARGIN + NOTICE_LETTERS * TextSize::Label.advance();
const MARGIN: u32 = 32;
/// From one line to the next.
const LINE: u32 = 34;
/// From the title to the first line.
const BELOW_TITLE: u32 = 56;

/// What is to be read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Notice {
    /// In larger letters, above the rest.
    pub title: String,
    /// Lines of at most [`NOTICE_LETTERS`], of which there are at most [`NOTICE_LINES`].
    pub lines: Vec<String>,
}

impl Notice {
    /// The panel that shows it.
    #[must_use]
    pub fn panel(&self) -> Panel {
        let lines = self.lines.iter().take(NOTICE_LINES);
        let count = u32::try_from(lines.len()).unwrap_or(0);
        let mut panel = card(WIDTH, 2 * MARGIN + BELOW_TITLE + count * LINE);
        let mut glyphs = Glyphs::default();
        let mut write = |y, size: TextSize, colour, text: &str| {
            let width = WIDTH - 2 * MARGIN;
            let text: String = (text.chars())
                .filter(|letter| !letter.is_control())
                .take((width / size.advance()) as usize)
                .collect();
            let place = Rect {
                x: MARGIN,
                y,
                width,
                height: line_height(size),
            };
            let shape = Shape::Text { size, text };
            let item = Item {
                place,
                colour,
                shape,
            };
            panel.draw(&item, &mut glyphs);
        };
        write(MARGIN, TextSize::Title, BRIGHT, &self.title);
        for (y, line) in (MARGIN + BELOW_TITLE..).step_by(LINE as usize).zip(lines) {
            write(y, TextSize::Label, DIM, line);
        }
        panel
    }
}

/// A line of text on an opaque strip `width` pixels wide: below a picture. What is too long for it is cut off.
#[must_use]
pub fn strip(text: &str, width: u32) -> Panel {
    let size = TextSize::Unit;
    let height = STRIP_HEIGHT;
    let [r, g, b] = CARD;
    let mut panel = Panel {
        width,
        height,
        pixels: [r, g, b, u8::MAX].repeat(width as usize * height as usize),
    };
    let within = width.saturating_sub(2 * STRIP_MARGIN);
    let text = (text.chars())
        .filter(|letter| !letter.is_control())
        .take((within / size.advance()) as usize)
        .collect();
    let place = Rect {
        x: STRIP_MARGIN,
        y: STRIP_MARGIN,
        width: within,
        height: line_height(size),
    };
    let item = Item {
        place,
        colour: BRIGHT,
        shape: Shape::Text { size, text },
    };
    panel.draw(&item, &mut Glyphs::default());
    panel
}

/// Height of a [`strip`], pixels.
pub const STRIP_HEIGHT: u32 = line_height(TextSize::Unit) + 2 * STRIP_MARGIN;
/// Around a strip's text, pixels.
const STRIP_MARGIN: u32 = 8;

#[cfg(test)]
mod tests {
    use super::*;

    fn notice(lines: usize) -> Notice {
        Notice {
            title: "No room yet".to_owned(),
            lines: (0..lines)
                .map(|k| format!("{k:02} {}", "m".repeat(57)))
                .collect(),
        }
    }

    /// Pixels of a row that are brighter than the card.
    fn bright(panel: &Panel, y: u32) -> Vec<u32> {
        let row = (y * panel.width) as usize * 4;
        let pixels = panel.pixels[row..row + panel.width as usize * 4].chunks_exact(4);
        let is_bright = |pixel: &[u8]| pixel[0] > 90;
        (0..)
            .zip(pixels)
            .filter_map(|(x, pixel)| is_bright(pixel).then_some(x))
            .collect()
    }

    #[test]
    fn the_longest_line_and_the_last_one_are_on_the_card() {
        let panel = notice(NOTICE_LINES).panel();
        let written: Vec<_> = (0..panel.height)
            .flat_map(|y| bright(&panel, y).into_iter().map(move |x| (x, y)))
            .collect();
        let right = written.iter().map(|(x, _)| *x).max().expect("text");
        let low = written.iter().map(|(_, y)| *y).max().expect("text");
        assert!(
            right > panel.width - 2 * MARGIN && right < panel.width - MARGIN / 2,
            "60 letters fill the line, to {right} of {}",
            panel.width
        );
        assert!(
            low > panel.height - 2 * MARGIN - LINE && low < panel.height - MARGIN / 2,
            "all lines fill the card, to {low} of {}",
            panel.height
        );
    }

    #[test]
    fn a_strip_holds_its_text_and_cuts_what_is_too_long() {
        let short = strip("29 Hz", 400);
        let long = strip(&"m".repeat(500), 400);
        for panel in [&short, &long] {
            assert_eq!((panel.width, panel.height), (400, STRIP_HEIGHT), "its size");
            assert!(
                panel.pixels.chunks_exact(4).all(|pixel| pixel[3] == 255),
                "it is opaque"
            );
        }
        let right = |panel: &Panel| {
            (0..panel.height)
                .filter_map(|y| bright(panel, y).pop())
                .max()
        };
        let (short, long) = (right(&short).expect("text"), right(&long).expect("text"));
        assert!(short < 100, "five letters end at {short}");
        assert!((350..400).contains(&long), "too many end at {long}");
        // Narrower than a letter.
        assert_eq!(strip("x", 3).pixels.len(), (3 * STRIP_HEIGHT * 4) as usize);
    }

    #[test]
    fn what_is_too_much_is_left_out() {
        let too_long = Notice {
            title: "x".repeat(500),
            lines: vec!["y".repeat(500); 500],
        };
        let fits = notice(NOTICE_LINES).panel();
        let panel = too_long.panel();
        assert_eq!(
            (panel.width, panel.height),
            (fits.width, fits.height),
            "no larger than the largest"
        );
        let odd = Notice {
            title: "\u{0}\u{7f}\n".to_owned(),
            lines: vec!["\u{202e}\t\u{1f600}".to_owned()],
        };
        assert!(!odd.panel().pixels.is_empty(), "odd letters are no error");
    }
}
