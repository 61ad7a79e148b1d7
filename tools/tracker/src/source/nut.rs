//! NUT, the container in which ffmpeg hands over raw pictures with their times: one stream of RGB, read from a pipe. After
//! the format's description, <https://ffmpeg.org/~michael/nut.txt>. Checksums are not looked at: a pipe does not err.

use std::io::{self, BufRead, Read};

const SIGNATURE: &[u8; 25] = b"nut/multimedia container\0";
const MAIN: u64 = 0x4e4d_7a56_1f5f_04ad;
const STREAM: u64 = 0x4e53_1140_5bf2_f9db;
const SYNCPOINT: u64 = 0x4e4b_e4ad_eeca_4569;

/// Of headers, of text and of frames' side data: far above what ffmpeg writes.
const LONGEST_PACKET: u64 = 1 << 20;

const END_OF_RELEVANCE: u64 = 2;
const CODED_PTS: u64 = 8;
const STREAM_ID: u64 = 16;
const SIZE_MSB: u64 = 32;
const CHECKSUM: u64 = 64;
const RESERVED: u64 = 128;
const SIDE_DATA: u64 = 256;
const HEADER_INDEX: u64 = 1024;
const MATCH_TIME: u64 = 2048;
const CODED_FLAGS: u64 = 4096;
const INVALID: u64 = 8192;

/// What a frame's first byte stands for.
#[derive(Debug, Clone, Copy, Default)]
struct FrameCode {
    flags: u64,
    stream: u64,
    size_factor: u64,
    size: u64,
    pts_delta: i64,
    reserved: u64,
    header: u64,
}

#[derive(Debug, Clone, Copy)]
struct TimeBase {
    num: u64,
    den: u64,
}

/// Reads the pictures of a NUT stream.
#[derive(Debug)]
pub(super) struct Nut<R> {
    input: R,
    codes: Vec<FrameCode>,
    /// Lengths of the elision headers: what frames leave out of their start. Raw pictures have none but the empty one.
    elided: Vec<u64>,
    bases: Vec<TimeBase>,
    base: TimeBase,
    pts_shift: u32,
    last_pts: i64,
    /// In pixels.
    pub(super) width: u32,
    /// In pixels.
    pub(super) height: u32,
}

fn bad(what: &str) -> io::Error {
    io::Error::new(
        io::ErrorKind::InvalidData,
        format!("ffmpeg's output is not what was expected: {what}"),
    )
}

impl<R: BufRead> Nut<R> {
    /// Reads up to the stream's header.
    pub(super) fn open(mut input: R) -> io::Result<Self> {
        let mut signature = [0; SIGNATURE.len()];
        input.read_exact(&mut signature)?;
        if signature != *SIGNATURE {
            return Err(bad("its signature"));
        }
        let mut nut = Self {
            input,
            codes: Vec::new(),
            elided: Vec::new(),
            bases: Vec::new(),
            base: TimeBase { num: 1, den: 1 },
            pts_shift: 0,
            last_pts: 0,
            width: 0,
            height: 0,
        };
        while nut.width == 0 {
            let mut start = [0; 8];
            nut.input.read_exact(&mut start)?;
            nut.read_packet(u64::from_be_bytes(start))?;
        }
        if nut.codes.is_empty() {
            return Err(bad("no main header"));
        }
        Ok(nut)
    }

    /// The next picture's bytes, which must be as many as `into` has, and its time in seconds; or nothing at the end.
    pub(super) fn frame(&mut self, into: &mut [u8]) -> io::Result<Option<f64>> {
        loop {
            let Some(first) = self.input.fill_buf()?.first().copied() else {
                return Ok(None);
            };
            self.input.consume(1);
            if first == b'N' {
                let mut start = [b'N'; 8];
                self.input.read_exact(&mut start[1..])?;
                self.read_packet(u64::from_be_bytes(start))?;
                continue;
            }
            let frame = self
                .codes
                .get(usize::from(first))
                .copied()
                .unwrap_or_default();
            let (size, flags) = self.read_frame_header(frame)?;
            if flags & END_OF_RELEVANCE != 0 && size == 0 {
                continue;
            }
            if size != into.len() as u64 {
                return Err(bad(&format!(
                    "a picture of {size} bytes instead of {}",
                    into.len()
                )));
            }
            self.input.read_exact(into)?;
            #[allow(
                clippy::cast_precision_loss,
                reason = "a time in ticks is far below 2^53"
            )]
            return Ok(Some(
                self.last_pts as f64 * (self.base.num as f64 / self.base.den as f64),
            ));
        }
    }

    /// The bytes of the frame's data that follow, and its flags. Sets the time.
    fn read_frame_header(&mut self, code: FrameCode) -> io::Result<(u64, u64)> {
        let input = &mut self.input;
        let (mut flags, mut stream, mut size, mut header, mut reserved) = (
            code.flags,
            code.stream,
            code.size,
            code.header,
            code.reserved,
        );
        if flags & INVALID != 0 {
            return Err(bad("a frame code that its header has not"));
        }
        if flags & CODED_FLAGS != 0 {
            flags ^= number(input)?;
        }
        if flags & STREAM_ID != 0 {
            stream = number(input)?;
        }
        let pts = if flags & CODED_PTS != 0 {
            let coded = number(input)?;
            let whole = 1u64 << self.pts_shift;
            if coded < whole {
                nearest_with_low_bits(self.last_pts, self.pts_shift, coded)
            } else {
                i64::try_from(coded - whole).ok()
            }
        } else {
            self.last_pts.checked_add(code.pts_delta)
        };
        if flags & SIZE_MSB != 0 {
            size = number(input)?
                .checked_mul(code.size_factor)
                .and_then(|more| size.checked_add(more))
                .ok_or_else(|| bad("a frame's size"))?;
        }
        if flags & MATCH_TIME != 0 {
            number(input)?;
        }
        if flags & HEADER_INDEX != 0 {
            header = number(input)?;
        }
        if flags & RESERVED != 0 {
            reserved = number(input)?;
        }
        for _ in 0..reserved.min(LONGEST_PACKET) {
            number(input)?;
        }
        if size > 4096 {
            header = 0;
        }
        let elided = usize::try_from(header)
            .ok()
            .and_then(|header| self.elided.get(header));
        size = elided
            .and_then(|elided| size.checked_sub(*elided))
            .ok_or_else(|| bad("a frame's elision header"))?;
        if flags & CHECKSUM != 0 {
            input.read_exact(&mut [0; 4])?;
        }
        if stream != 0 || flags & SIDE_DATA != 0 {
            return Err(bad("a frame of something else than pictures"));
        }
        self.last_pts = pts.ok_or_else(|| bad("a frame's time"))?;
        Ok((size, flags))
    }

    fn read_packet(&mut self, start: u64) -> io::Result<()> {
        if start >> 56 != u64::from(b'N') {
            return Err(bad("a packet's start"));
        }
        let length = number(&mut self.input)?;
        if length > LONGEST_PACKET {
            return Err(bad("a packet's length"));
        }
        if length > 4096 {
            self.input.read_exact(&mut [0; 4])?;
        }
        let mut packet = Vec::new();
        (&mut self.input).take(length).read_to_end(&mut packet)?;
        if packet.len() as u64 != length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let rest = &mut packet.as_slice();
        match start {
            MAIN => self.read_main(rest),
            STREAM => self.read_stream(rest),
            SYNCPOINT => self.read_syncpoint(rest),
            // Text, an index, what later versions add.
            _ => Ok(()),
        }
    }

    fn read_main(&mut self, rest: &mut &[u8]) -> io::Result<()> {
        if number(rest)? > 3 {
            number(rest)?;
        }
        if number(rest)? != 1 {
            return Err(bad("more than one stream"));
        }
        number(rest)?;
        let bases = number(rest)?;
        self.bases.clear();
        for _ in 0..bases.min(LONGEST_PACKET) {
            let (num, den) = (number(rest)?, number(rest)?);
            if num == 0 || den == 0 {
                return Err(bad("a time base"));
            }
            self.bases.push(TimeBase { num, den });
        }
        self.codes = read_codes(rest)?;
        let more = number(rest)?;
        self.elided = vec![0];
        for _ in 0..more.min(256) {
            let length = number(rest)?;
            let skipped = usize::try_from(length)
                .ok()
                .and_then(|length| rest.split_at_checked(length));
            *rest = skipped.ok_or_else(|| bad("an elision header"))?.1;
            self.elided.push(length);
        }
        Ok(())
    }

    fn read_stream(&mut self, rest: &mut &[u8]) -> io::Result<()> {
        let (_id, class) = (number(rest)?, number(rest)?);
        if class != 0 {
            return Err(bad("a stream of something else than pictures"));
        }
        let fourcc = number(rest)?;
        let skipped = usize::try_from(fourcc)
            .ok()
            .and_then(|length| rest.split_at_checked(length));
        *rest = skipped.ok_or_else(|| bad("a codec's name"))?.1;
        let base = number(rest)?;
        let base = usize::try_from(base)
            .ok()
            .and_then(|base| self.bases.get(base));
        self.base = *base.ok_or_else(|| bad("a stream's time base"))?;
        self.pts_shift = u32::try_from(number(rest)?)
            .ok()
            .filter(|shift| *shift < 32)
            .ok_or_else(|| bad("a time's bits"))?;
        for _ in 0..3 {
            number(rest)?;
        }
        let specific = number(rest)?;
        let skipped = usize::try_from(specific)
            .ok()
            .and_then(|length| rest.split_at_checked(length));
        *rest = skipped.ok_or_else(|| bad("a codec's data"))?.1;
        let side = |value: u64| {
            u32::try_from(value)
                .ok()
                .filter(|value| *value > 0)
                .ok_or_else(|| bad("a picture's size"))
        };
        self.width = side(number(rest)?)?;
        self.height = side(number(rest)?)?;
        Ok(())
    }

    /// Times are counted from here on.
    fn read_syncpoint(&mut self, rest: &mut &[u8]) -> io::Result<()> {
        let coded = number(rest)?;
        let count = self.bases.len() as u64;
        if count == 0 {
            return Err(bad("a sync point before the main header"));
        }
        let (ticks, base) = (coded / count, coded % count);
        let base = usize::try_from(base)
            .ok()
            .and_then(|base| self.bases.get(base));
        let base = base.ok_or_else(|| bad("a sync point's time base"))?;
        // All four are below 2^64, but a product of three may not fit: then the time is no time.
        let pts = u128::from(ticks)
            .checked_mul(u128::from(base.num))
            .and_then(|above| above.checked_mul(u128::from(self.base.den)))
            .and_then(|above| {
                Some(above / u128::from(base.den).checked_mul(u128::from(self.base.num))?)
            })
            .and_then(|pts| i64::try_from(pts).ok());
        self.last_pts = pts.ok_or_else(|| bad("a sync point's time"))?;
        Ok(())
    }
}

fn read_codes(rest: &mut &[u8]) -> io::Result<Vec<FrameCode>> {
    let mut codes = Vec::with_capacity(256);
    let mut code = FrameCode {
        size_factor: 1,
        ..FrameCode::default()
    };
    while codes.len() < 256 {
        code.flags = number(rest)?;
        let fields = number(rest)?;
        if fields > 0 {
            code.pts_delta = signed(number(rest)?);
        }
        if fields > 1 {
            code.size_factor = number(rest)?;
        }
        if fields > 2 {
            code.stream = number(rest)?;
        }
        let size = if fields > 3 { number(rest)? } else { 0 };
        code.reserved = if fields > 4 { number(rest)? } else { 0 };
        let count = if fields > 5 {
            number(rest)?
        } else {
            code.size_factor.saturating_sub(size)
        };
        if fields > 6 {
            number(rest)?;
        }
        if fields > 7 {
            code.header = number(rest)?;
        }
        for _ in 8..fields.min(LONGEST_PACKET) {
            number(rest)?;
        }
        if count == 0 || count > 256 {
            return Err(bad("its frame codes"));
        }
        for index in 0..count {
            if codes.len() == usize::from(b'N') {
                codes.push(FrameCode {
                    flags: INVALID,
                    ..FrameCode::default()
                });
            }
            codes.push(FrameCode {
                size: size
                    .checked_add(index)
                    .ok_or_else(|| bad("its frame codes"))?,
                ..code
            });
        }
    }
    codes.truncate(256);
    Ok(codes)
}

/// The time nearest to the last one that ends in `low`.
fn nearest_with_low_bits(last: i64, shift: u32, low: u64) -> Option<i64> {
    let mask = (1i64 << shift) - 1;
    let from = last.checked_sub(mask / 2)?;
    (i64::try_from(low).ok()?.wrapping_sub(from) & mask).checked_add(from)
}

/// Seven bits a byte, the highest first; the eighth says that more follow.
fn number(input: &mut impl Read) -> io::Result<u64> {
    let mut value = 0u64;
    for _ in 0..10 {
        let mut byte = [0];
        input.read_exact(&mut byte)?;
        value = value.checked_mul(128).ok_or_else(|| bad("a number"))? | u64::from(byte[0] & 127);
        if byte[0] & 128 == 0 {
            return Ok(value);
        }
    }
    Err(bad("a number"))
}

/// Signs are in the lowest bit.
fn signed(coded: u64) -> i64 {
    let above = coded.saturating_add(1);
    #[allow(clippy::cast_possible_wrap, reason = "halved, it fits")]
    let half = (above >> 1) as i64;
    if above & 1 == 1 { -half } else { half }
}

#[cfg(test)]
mod tests;
