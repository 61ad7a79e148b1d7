//! How the `compact` codec writes a residual, the difference of a value from its prediction: a range coder (the `constriction` crate)
//! over a family of tables, one for each expected size (spread) of the residual.
//!
//! Tables and choice of table are integer arithmetic only, so that any two machines agree bit for bit. Reading and writing
//! are one trait, so that the walk over a frame is written once for both.

use crate::decode_error::DecodeError;
use crate::grid::MAX_STEPS;
use constriction::backends::{ReadWords, WriteWords};
use constriction::stream::model::{ContiguousCategoricalEntropyModel, UniformModel};
use constriction::stream::queue::{RangeDecoder, RangeEncoder};
use constriction::stream::{Decode, Encode};
use constriction::{Queue, UnwrapInfallible};
use std::convert::Infallible;
use std::sync::LazyLock;

/// A spread is counted in sixteenths of a grid step.
pub(crate) const SPREAD_ONE: u32 = 16;

const PRECISION: usize = 16;
type Table = ContiguousCategoricalEntropyModel<u16, Vec<u16>, PRECISION>;
type Bits = UniformModel<u16, PRECISION>;

/// A table holds the residuals -LARGEST..=LARGEST, then one escape symbol for all others.
const LARGEST: i32 = 31;
const BEYOND: usize = 2 * LARGEST as usize + 1;
/// Half octaves of spread with a table of their own, from one sixteenth of a step; wider ones leave out low bits first.
const TABLES: u32 = 15;

static FAMILY: LazyLock<Vec<Table>> = LazyLock::new(|| (0..TABLES).map(table).collect());

/// The table for the spread 2^(`half_octave`/2)/16 steps: Student's t with two degrees of freedom,
/// (1 + m^2/2s^2)^-1.5. A residual is normally distributed with a spread that is itself only estimated, hence the long tails.
fn table(half_octave: u32) -> Table {
    // s^2 and m^2/2 in 256ths of a squared step; 2^half_octave is s^2 exactly.
    let s2 = 1u64 << half_octave;
    let weight = |residual: i32| {
        let m2 = u64::from(residual.unsigned_abs()).pow(2) << 7;
        let share = (s2 << 24) / (s2 + m2);
        share * share.isqrt()
    };
    let beyond = (LARGEST + 1..16 * LARGEST)
        .map(|m| 2 * weight(m))
        .sum::<u64>();
    let weights: Vec<u64> = (-LARGEST..=LARGEST).map(weight).chain([beyond]).collect();
    let total: u64 = weights.iter().sum();
    let free = (1 << PRECISION) - weights.len() as u64;
    let mut below = 0;
    let at = |below: u64| below * free / total;
    let shares = weights.iter().map(|weight| {
        let share = 1 + at(below + weight) - at(below);
        below += weight;
        u16::try_from(share).unwrap_or(u16::MAX)
    });
    Table::from_nonzero_fixed_point_probabilities(shares, false)
        .expect("the shares are positive and add up to 2^16 by construction")
}

/// One end of the range coder. A writer writes the argument and returns it; a reader ignores the argument and returns what it read.
pub(crate) trait Coder {
    /// A symbol of `table`.
    fn symbol(&mut self, table: &Table, symbol: usize) -> Result<usize, DecodeError>;

    /// The low `count` bits of a number, at most 15 of them, each as likely as not.
    fn few_bits(&mut self, count: u32, bits: u16) -> Result<u16, DecodeError>;

    /// The low `count` bits of a number.
    fn bits(&mut self, count: u32, value: u64) -> Result<u64, DecodeError> {
        let mut out = 0;
        for at in (0..count).step_by(8) {
            let some = (count - at).min(8);
            #[allow(clippy::cast_possible_truncation, reason = "masked to eight bits")]
            let part = ((value >> at) & ((1 << some) - 1)) as u16;
            out |= u64::from(self.few_bits(some, part)?) << at;
        }
        Ok(out)
    }

    /// A number below 2^63 without a prediction: its length in bits, then the bits.
    fn wide(&mut self, value: u64) -> Result<u64, DecodeError> {
        let above = value + 1;
        let length = self.bits(6, u64::from(above.ilog2()))?;
        let length = u32::try_from(length).unwrap_or(63);
        Ok((self.bits(length, above)? | 1 << length) - 1)
    }

    /// A residual that is expected to be about `spread`/16 steps.
    fn residual(&mut self, spread: u32, residual: i32) -> Result<i32, DecodeError> {
        let half_octave = spread.clamp(1, 1 << 15).pow(2).ilog2();
        let dropped = half_octave.saturating_sub(TABLES - 1).div_ceil(2);
        let table = &FAMILY[(half_octave - 2 * dropped) as usize];
        let high = residual >> dropped;
        let symbol = usize::try_from(high + LARGEST)
            .unwrap_or(BEYOND)
            .min(BEYOND);
        let symbol = self.symbol(table, symbol)?;
        let high = if symbol == BEYOND {
            let further = high
                .unsigned_abs()
                .saturating_sub(LARGEST.unsigned_abs() + 1);
            let further = self.wide(u64::from(further))?;
            let size = i32::try_from(further).unwrap_or(MAX_STEPS).min(MAX_STEPS) + LARGEST + 1;
            if self.few_bits(1, u16::from(high < 0))? == 1 {
                -size
            } else {
                size
            }
        } else {
            i32::try_from(symbol).unwrap_or(0) - LARGEST
        };
        let low = u16::try_from(residual & ((1 << dropped) - 1)).unwrap_or(0);
        let low = self.few_bits(dropped, low)?;
        Ok(high
            .saturating_mul(1 << dropped)
            .saturating_add(i32::from(low)))
    }
}

/// Writes at the end of a message.
pub(crate) struct Writer<'a>(RangeEncoder<u16, u64, Message<'a>>);

struct Message<'a>(&'a mut Vec<u8>);

impl WriteWords<u16> for Message<'_> {
    type WriteError = Infallible;

    fn write(&mut self, word: u16) -> Result<(), Infallible> {
        self.0.extend_from_slice(&word.to_be_bytes());
        Ok(())
    }
}

impl<'a> Writer<'a> {
    pub(crate) fn new(message: &'a mut Vec<u8>) -> Self {
        Self(RangeEncoder::with_write_backend(Message(message)))
    }

    /// Completes the message. Zeros at its end are left out: a reader finds them past the end.
    pub(crate) fn finish(self) {
        let message = self.0.into_compressed().unwrap_infallible().0;
        while message.last() == Some(&0) {
            message.pop();
        }
    }
}

impl Coder for Writer<'_> {
    fn symbol(&mut self, table: &Table, symbol: usize) -> Result<usize, DecodeError> {
        // Every table holds every symbol, and a message grows without limit.
        self.0
            .encode_symbol(symbol, table)
            .map_err(|_| DecodeError::Length)?;
        Ok(symbol)
    }

    fn few_bits(&mut self, count: u32, bits: u16) -> Result<u16, DecodeError> {
        if count > 0 {
            self.0
                .encode_symbol(usize::from(bits), Bits::new(1 << count))
                .map_err(|_| DecodeError::Length)?;
        }
        Ok(bits)
    }
}

/// Reads a message.
pub(crate) struct Reader<'a>(RangeDecoder<u16, u64, Rest<'a>>);

struct Rest<'a>(&'a [u8]);

impl ReadWords<u16, Queue> for Rest<'_> {
    type ReadError = Infallible;

    fn read(&mut self) -> Result<Option<u16>, Infallible> {
        let (word, rest) = match *self.0 {
            [] => return Ok(None),
            [last] => ([last, 0], &[][..]),
            [high, low, ref rest @ ..] => ([high, low], rest),
        };
        self.0 = rest;
        Ok(Some(u16::from_be_bytes(word)))
    }
}

impl<'a> Reader<'a> {
    pub(crate) fn new(message: &'a [u8]) -> Self {
        Self(RangeDecoder::with_backend(Rest(message)).unwrap_infallible())
    }

    /// Refuses a message that goes on after its last number.
    pub(crate) fn finish(self) -> Result<(), DecodeError> {
        let (rest, ..) = self.0.into_raw_parts();
        if rest.0.is_empty() {
            Ok(())
        } else {
            Err(DecodeError::Length)
        }
    }
}

impl Coder for Reader<'_> {
    fn symbol(&mut self, table: &Table, _: usize) -> Result<usize, DecodeError> {
        self.0
            .decode_symbol(table)
            .map_err(|_| DecodeError::Corrupt)
    }

    fn few_bits(&mut self, count: u32, _: u16) -> Result<u16, DecodeError> {
        if count == 0 {
            return Ok(0);
        }
        self.0
            .decode_symbol(Bits::new(1 << count))
            .ok()
            .and_then(|bits| u16::try_from(bits).ok())
            .ok_or(DecodeError::Corrupt)
    }
}
