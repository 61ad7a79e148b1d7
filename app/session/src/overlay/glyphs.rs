//! Glyphs of the panel's font as coverage, rasterised once for each size.
//!
//! The font is Hack: monospaced, so that figures do not jump about, and drawn for small sizes.

use ab_glyph::{Font, FontRef, ScaleFont};
use std::collections::HashMap;

/// Sizes of text, by what a character is wide: whole pixels, so that gaps between letters are even.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum TextSize {
    Title,
    Value,
    Label,
    Unit,
}

impl TextSize {
    /// Pixels from one character to the next.
    pub(super) const fn advance(self) -> u32 {
        match self {
            Self::Title => 18,
            Self::Value => 15,
            Self::Label => 13,
            Self::Unit => 12,
        }
    }
}

/// One glyph's coverage, 0 to 255, rows from the top.
#[derive(Debug, Default)]
pub(super) struct Glyph {
    /// Pixels from the pen to the left edge, and from the base line down to the upper edge.
    pub(super) left: i32,
    pub(super) top: i32,
    pub(super) width: u32,
    pub(super) coverage: Vec<u8>,
}

/// Glyphs rasterised so far: the panel has some fifty different ones.
#[derive(Debug)]
pub(super) struct Glyphs {
    font: Option<FontRef<'static>>,
    known: HashMap<(char, TextSize), Glyph>,
}

impl Default for Glyphs {
    fn default() -> Self {
        // The font is part of the program; a panel without letters would be a programming error that a test finds.
        let font = FontRef::try_from_slice(epaint_default_fonts::HACK_REGULAR);
        Self {
            font: font.ok(),
            known: HashMap::new(),
        }
    }
}

impl Glyphs {
    /// The glyph of `letter`; that of a missing one where the font has none.
    pub(super) fn get(&mut self, letter: char, size: TextSize) -> &Glyph {
        let font = &self.font;
        self.known.entry((letter, size)).or_insert_with(|| {
            font.as_ref()
                .and_then(|font| rasterise(font, letter, size))
                .unwrap_or_default()
        })
    }
}

fn rasterise(font: &FontRef<'_>, letter: char, size: TextSize) -> Option<Glyph> {
    let id = font.glyph_id(letter);
    let scale = font.height_unscaled() * size.advance() as f32 / font.h_advance_unscaled(id);
    let outlined = font.as_scaled(scale).scaled_glyph(letter);
    let outlined = font.outline_glyph(outlined)?;
    let bounds = outlined.px_bounds();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole pixels of one letter"
    )]
    let (left, top, width, height) = (
        bounds.min.x as i32,
        bounds.min.y as i32,
        bounds.width() as u32,
        bounds.height() as u32,
    );
    let mut coverage = vec![0; width as usize * height as usize];
    outlined.draw(|x, y, share| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of 255"
        )]
        let share = (share.clamp(0.0, 1.0) * 255.0).round() as u8;
        if let Some(place) = coverage.get_mut((y * width + x) as usize) {
            *place = share;
        }
    });
    Some(Glyph {
        left,
        top,
        width,
        coverage,
    })
}
