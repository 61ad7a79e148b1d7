//! What stands where on the panel: rows of a label and two figures, bars for units, a strip of frame times.

use super::glyphs::TextSize;
use super::words::{NONE, count, cut, number};
use super::{OverlayFigures, UnitLoad};
use app_pipeline::profile::Since;
use app_pipeline::quality::LADDER;
use app_pipeline::stage::Unit;

/// Red, green and blue as displayed, 0 to 255.
pub(super) type Colour = [u8; 3];

pub(super) const WIDTH: u32 = 640;
pub(super) const HEIGHT: u32 = 536;

/// Pixels, x to the right and y down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) width: u32,
    pub(super) height: u32,
}

/// Something to be drawn.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Item {
    pub(super) place: Rect,
    pub(super) colour: Colour,
    pub(super) shape: Shape,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shape {
    /// All of the place, with so much of 255.
    Fill(u8),
    /// One line of text, cut to its place.
    Text { size: TextSize, text: String },
}

/// What a column is for.
#[derive(Debug, Clone, Copy)]
enum Cell {
    Label,
    /// The first figure, its number set to the right, and what it is of.
    First,
    FirstUnit,
    Second,
    SecondUnit,
    /// A unit's bar, in place of the first figure.
    Bar,
    /// Both figures' columns in one.
    Wide,
}

impl Cell {
    /// From where to where, pixels.
    pub(super) const fn columns(self) -> [u32; 2] {
        match self {
            Self::Label => [MARGIN, 168],
            Self::First => [176, 281],
            Self::FirstUnit => [289, 397],
            Self::Second => [405, 495],
            Self::SecondUnit => [503, WIDTH - MARGIN],
            Self::Bar => [176, 397],
            Self::Wide => [176, WIDTH - MARGIN],
        }
    }
}

/// The last step of quality: of so many, the panel tells how many are given up.
const LAST: usize = LADDER.len() - 1;

const MARGIN: u32 = 29;
/// From one row to the next.
const ROW: u32 = 38;
/// Height of the strip of frame times, of which the display's period is half.
const STRIP: u32 = 54;
/// A frame in the strip, and the gap after it.
const FRAME: u32 = 3;
const GAP: u32 = 1;
/// Height of a unit's bar.
const BAR: u32 = 14;

pub(super) const BRIGHT: Colour = [240, 244, 248];
pub(super) const DIM: Colour = [158, 168, 182];
const FAINT: Colour = [74, 82, 94];
const IN_TIME: Colour = [176, 192, 208];
const LATE: Colour = [255, 122, 96];
const OF_UNITS: [Colour; Unit::ALL.len()] = [[190, 150, 250], [124, 212, 150], [112, 190, 226]];

/// Everything on the panel.
pub(super) fn items(figures: &OverlayFigures) -> Vec<Item> {
    let mut page = Page {
        items: Vec::with_capacity(figures.frames.len() + 64),
        y: 26,
    };
    page.title(figures);
    page.rates(figures);
    page.strip(figures);
    for (unit, colour) in Unit::ALL.into_iter().zip(OF_UNITS) {
        page.unit(unit, colour, figures.units[unit as usize]);
    }
    page.rule();
    page.call(figures);
    page.items
}

/// Rows from the top.
struct Page {
    items: Vec<Item>,
    /// Where the next row begins.
    y: u32,
}

impl Page {
    fn title(&mut self, figures: &OverlayFigures) {
        let size = TextSize::Title;
        self.text(Cell::Label, size, BRIGHT, "Mon3tr", Side::Left);
        if let Some(placement) = &figures.placement {
            self.text(Cell::Wide, TextSize::Label, DIM, placement, Side::Right);
        }
        self.y += 42;
        self.rule();
    }

    fn rates(&mut self, figures: &OverlayFigures) {
        let mut times: Vec<f64> = figures.frames.iter().map(|one| f64::from(one.ms)).collect();
        times.sort_unstable_by(f64::total_cmp);
        let median = times.get(times.len().saturating_sub(1) / 2).copied();
        let late = figures.frames.iter().filter(|one| one.is_late).count() as u64;
        let shown = figures.frames.len() as u64;
        let hertz = match figures.display_hz {
            Some(hertz) => format!("of {} Hz", number(Some(hertz), 0)),
            None => "Hz".to_owned(),
        };
        self.row(
            "Display",
            (number(figures.shown_hz, 1), &hertz),
            (number(median, 1), "ms/frame"),
        );
        self.row(
            "Late",
            (
                count((shown > 0).then_some(late)),
                &format!("of {}", count((shown > 0).then_some(shown))),
            ),
            (count(figures.late_in_all), "in all"),
        );
    }

    /// A bar for each of the last frames, as high as it took; the line is the display's period.
    fn strip(&mut self, figures: &OverlayFigures) {
        self.y += 6;
        let width = WIDTH - 2 * MARGIN;
        let period_ms = figures.display_hz.map_or(0.0, |hertz| 1e3 / hertz);
        self.fill([MARGIN, self.y, width, STRIP], FAINT, 60);
        let most = (width / (FRAME + GAP)) as usize;
        let last = figures.frames.len().saturating_sub(most);
        for (x, frame) in (MARGIN..)
            .step_by((FRAME + GAP) as usize)
            .zip(&figures.frames[last..])
        {
            let share = f64::from(frame.ms) / (2.0 * period_ms).max(1e-3);
            let height = pixels(share, STRIP).max(2);
            let colour = if frame.is_late { LATE } else { IN_TIME };
            self.fill([x, self.y + STRIP - height, FRAME, height], colour, 255);
        }
        self.fill([MARGIN, self.y + STRIP / 2, width, 1], BRIGHT, 150);
        self.y += STRIP + 12;
    }

    /// How much of the time a unit works, and how long for each picture.
    fn unit(&mut self, unit: Unit, colour: Colour, load: Option<UnitLoad>) {
        let [x, end] = Cell::Bar.columns();
        let y = self.y + ROW / 2 - BAR / 2;
        self.fill([x, y, end - x, BAR], FAINT, 110);
        let share = load.map_or(0.0, |load| load.share);
        let filled = pixels(share, end - x);
        if filled > 0 {
            self.fill([x, y, filled, BAR], colour, 255);
        }
        let ms = number(load.map(|load| load.ms), 1);
        self.row(unit.name(), (String::new(), ""), (ms, "ms/frame"));
    }

    fn call(&mut self, figures: &OverlayFigures) {
        let latency = figures.latency;
        let since = match latency.map(|latency| latency.since) {
            Some(Since::Arrival) => "From here",
            Some(Since::Capture) | None => "Latency",
        };
        self.row(
            since,
            (number(latency.map(|one| one.p50_ms), 0), "ms p50"),
            (number(latency.map(|one| one.p95_ms), 0), "ms p95"),
        );
        self.row(
            "Network",
            (number(figures.kbit_s, 0), "kbit/s"),
            (number(figures.loss.map(|loss| loss * 100.0), 1), "% lost"),
        );
        let quality = figures.quality;
        let kept = quality.map(|one| 100.0 * f64::from(one.kept_share()));
        self.row(
            "Gaussians",
            (count(figures.gaussians.map(u64::from)), "drawn"),
            (number(kept, 0), "% kept"),
        );
        let size = quality.map(|one| 100.0 * f64::from(one.resolution_scale));
        let step = quality.map(|one| format!("{}/{}", one.step.min(LAST), LAST));
        self.row(
            "Quality",
            (number(size, 0), "% size"),
            (step.unwrap_or_else(|| NONE.to_owned()), "given up"),
        );
    }

    fn row(&mut self, label: &str, first: (String, &str), second: (String, &str)) {
        self.text(Cell::Label, TextSize::Label, DIM, label, Side::Left);
        for (cells, (number, unit)) in [
            ([Cell::First, Cell::FirstUnit], first),
            ([Cell::Second, Cell::SecondUnit], second),
        ] {
            self.text(cells[0], TextSize::Value, BRIGHT, &number, Side::Right);
            self.text(cells[1], TextSize::Unit, DIM, unit, Side::Left);
        }
        self.y += ROW;
    }

    fn rule(&mut self) {
        self.fill([MARGIN, self.y + 4, WIDTH - 2 * MARGIN, 1], DIM, 90);
        self.y += 12;
    }

    fn text(&mut self, cell: Cell, size: TextSize, colour: Colour, text: &str, side: Side) {
        let [begin, end] = cell.columns();
        let text = cut(text, ((end - begin) / size.advance()) as usize);
        if text.is_empty() {
            return;
        }
        let letters = u32::try_from(text.chars().count()).unwrap_or(0);
        let width = letters * size.advance();
        let x = match side {
            Side::Left => begin,
            Side::Right => end - width,
        };
        // All sizes of a row stand on one line.
        let y = self.y + BASE_LINE - base_line(size);
        self.items.push(Item {
            place: Rect {
                x,
                y,
                width,
                height: line_height(size),
            },
            colour,
            shape: Shape::Text { size, text },
        });
    }

    fn fill(&mut self, [x, y, width, height]: [u32; 4], colour: Colour, opacity: u8) {
        self.items.push(Item {
            place: Rect {
                x,
                y,
                width,
                height,
            },
            colour,
            shape: Shape::Fill(opacity),
        });
    }
}

/// Which edge of its column text keeps to.
#[derive(Debug, Clone, Copy)]
enum Side {
    Left,
    Right,
}

/// From a row's top to the line that its text stands on.
const BASE_LINE: u32 = 27;

/// Height of a line of text with room for what hangs below.
pub(super) const fn line_height(size: TextSize) -> u32 {
    size.advance() * 2
}

/// From the top of a line of text to what it stands on.
pub(super) const fn base_line(size: TextSize) -> u32 {
    size.advance() * 3 / 2
}

/// So much of `all` pixels.
fn pixels(share: f64, all: u32) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a few hundred pixels; what is no number is none"
    )]
    let pixels = (share.clamp(0.0, 1.0) * f64::from(all)).round() as u32;
    pixels
}
