//! A canvas in pixels and axes with round numbers: the little that both charts share.

use plotters::{
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use crate::NetlabError;

/// Okabe and Ito's colours, which people with any kind of colour vision tell apart; yellow is left out, it is too pale for lines.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(60, 60, 60),
];
pub(super) const INK: RGBColor = RGBColor(34, 34, 34);
pub(super) const FAINT: RGBColor = RGBColor(100, 100, 100);
pub(super) const GRID: RGBColor = RGBColor(222, 222, 222);

pub(super) fn colour(index: usize) -> RGBColor {
    COLOURS.get(index % COLOURS.len()).copied().unwrap_or(BLACK)
}

/// Paler, for what belongs to a colour but is second.
pub(super) fn pale(RGBColor(r, g, b): RGBColor) -> RGBColor {
    let half = |c: u8| c / 2 + 127;
    RGBColor(half(r), half(g), half(b))
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
}

/// A white picture being drawn; coordinates in pixels from the upper left.
pub(super) struct Canvas<'a> {
    area: DrawingArea<SVGBackend<'a>, plotters::coord::Shift>,
}

fn px(value: f64) -> i32 {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "clamped to a picture's size first"
    )]
    {
        value.clamp(-10_000.0, 10_000.0).round() as i32
    }
}

fn failed(error: impl std::fmt::Display) -> NetlabError {
    NetlabError::Chart(error.to_string())
}

impl<'a> Canvas<'a> {
    pub(super) fn new(svg: &'a mut String, width: f64, height: f64) -> Result<Self, NetlabError> {
        let size = (px(width).unsigned_abs(), px(height).unsigned_abs());
        let area = SVGBackend::with_string(svg, size).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        Ok(Self { area })
    }

    pub(super) fn finish(self) -> Result<(), NetlabError> {
        self.area.present().map_err(failed)
    }

    /// Text whose middle line is at `y`.
    pub(super) fn text(
        &self,
        text: &str,
        (x, y): (f64, f64),
        size: f64,
        anchor: Anchor,
        colour: RGBColor,
    ) -> Result<(), NetlabError> {
        let at = match anchor {
            Anchor::Left => HPos::Left,
            Anchor::Middle => HPos::Center,
            Anchor::Right => HPos::Right,
        };
        let style = ("sans-serif", size)
            .into_font()
            .color(&colour)
            .pos(Pos::new(at, VPos::Center));
        self.area
            .draw_text(text, &style, (px(x), px(y)))
            .map_err(failed)
    }

    pub(super) fn bold(
        &self,
        text: &str,
        (x, y): (f64, f64),
        size: f64,
    ) -> Result<(), NetlabError> {
        let style = ("sans-serif", size)
            .into_font()
            .style(FontStyle::Bold)
            .color(&INK)
            .pos(Pos::new(HPos::Left, VPos::Center));
        self.area
            .draw_text(text, &style, (px(x), px(y)))
            .map_err(failed)
    }

    pub(super) fn line(
        &self,
        points: &[(f64, f64)],
        width: u32,
        colour: RGBColor,
    ) -> Result<(), NetlabError> {
        let points: Vec<(i32, i32)> = points.iter().map(|&(x, y)| (px(x), px(y))).collect();
        self.area
            .draw(&PathElement::new(points, colour.stroke_width(width)))
            .map_err(failed)
    }

    pub(super) fn bar(
        &self,
        (x0, x1): (f64, f64),
        y: f64,
        height: f64,
        colour: RGBColor,
    ) -> Result<(), NetlabError> {
        let corners = [
            (px(x0), px(y - height / 2.0)),
            (px(x1), px(y + height / 2.0)),
        ];
        self.area
            .draw(&Rectangle::new(corners, colour.filled()))
            .map_err(failed)
    }

    pub(super) fn dot(&self, (x, y): (f64, f64), colour: RGBColor) -> Result<(), NetlabError> {
        self.area
            .draw(&Circle::new((px(x), px(y)), 5, colour.filled()))
            .map_err(failed)
    }

    /// A ring with white in it.
    pub(super) fn ring(&self, (x, y): (f64, f64), colour: RGBColor) -> Result<(), NetlabError> {
        let at = (px(x), px(y));
        self.area
            .draw(&Circle::new(at, 5, WHITE.filled()))
            .map_err(failed)?;
        self.area
            .draw(&Circle::new(at, 5, colour.stroke_width(2)))
            .map_err(failed)
    }

    /// An upright stroke, as the end of a range.
    pub(super) fn end(&self, (x, y): (f64, f64), colour: RGBColor) -> Result<(), NetlabError> {
        self.line(&[(x, y - 6.0), (x, y + 6.0)], 3, colour)
    }
}

/// Numbers to pixels, with ticks at round numbers.
pub(super) struct Axis {
    from: f64,
    to: f64,
    start: f64,
    end: f64,
    is_log: bool,
    pub(super) ticks: Vec<f64>,
}

impl Axis {
    /// From 0 to a round number at or above the greatest.
    pub(super) fn linear(greatest: f64, (start, end): (f64, f64), ticks: f64) -> Self {
        let greatest = if greatest.is_finite() && greatest > 0.0 {
            greatest
        } else {
            1.0
        };
        let step = round_up(greatest / ticks);
        let count = (greatest / step - 1e-9).ceil();
        let mut at = vec![0.0];
        while at.len() as f64 <= count {
            at.push(at.len() as f64 * step);
        }
        Self {
            from: 0.0,
            to: count * step,
            start,
            end,
            is_log: false,
            ticks: at,
        }
    }

    /// Logarithmic, over all the numbers.
    pub(super) fn logarithmic(
        numbers: impl Iterator<Item = f64> + Clone,
        (start, end): (f64, f64),
    ) -> Self {
        let positive = numbers.filter(|n| n.is_finite() && *n > 0.0);
        let least = positive.clone().fold(f64::INFINITY, f64::min);
        let (least, greatest) = if least.is_finite() {
            (least, positive.fold(least, f64::max))
        } else {
            (1.0, 10.0)
        };
        // A little room, so that no dot sits on the frame.
        let from = 1.0 / round_up(1.0 / (least * 0.93));
        let to = round_up(greatest * 1.07);
        let decades = (to / from).log10();
        let mut ticks = Vec::new();
        let mut decade = 10.0_f64.powf(from.log10().floor());
        while decade <= to * 1.001 {
            let steps: &[f64] = if decades > 3.2 {
                &[1.0]
            } else {
                &[1.0, 2.0, 5.0]
            };
            for step in steps {
                let tick = decade * step;
                if (from * 0.999..=to * 1.001).contains(&tick) {
                    ticks.push(tick);
                }
            }
            decade *= 10.0;
        }
        Self {
            from,
            to,
            start,
            end,
            is_log: true,
            ticks,
        }
    }

    pub(super) fn at(&self, number: f64) -> f64 {
        let share = if self.is_log {
            (number / self.from).ln() / (self.to / self.from).ln()
        } else {
            (number - self.from) / (self.to - self.from)
        };
        self.start + share.clamp(0.0, 1.0) * (self.end - self.start)
    }
}

/// The next of 1, 2, 5, 10, ... at or above a positive number.
fn round_up(number: f64) -> f64 {
    let decade = 10.0_f64.powf(number.log10().floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|step| step * decade)
        .find(|&round| round >= number * 0.999_999)
        .unwrap_or(decade * 10.0)
}

/// A tick's number without needless digits.
pub(super) fn number(value: f64) -> String {
    let rounded = (value * 1000.0).round() / 1000.0;
    format!("{rounded}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_round_and_hold_their_numbers() {
        let axis = Axis::linear(134.9, (100.0, 300.0), 5.0);
        assert_eq!(axis.ticks, [0.0, 50.0, 100.0, 150.0], "linear");
        assert_eq!(axis.at(75.0), 200.0, "half way");
        let axis = Axis::logarithmic([20.4, 1067.0].into_iter(), (0.0, 1.0));
        assert_eq!(
            axis.ticks,
            [10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0],
            "logarithmic"
        );
        for empty in [
            Axis::linear(0.0, (0.0, 1.0), 5.0),
            Axis::logarithmic([].into_iter(), (0.0, 1.0)),
        ] {
            assert!(
                !empty.ticks.is_empty() && empty.at(1.0).is_finite(),
                "of nothing"
            );
        }
    }
}
