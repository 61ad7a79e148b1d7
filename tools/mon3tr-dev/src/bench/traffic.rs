//! How many bytes a frame has to move, from the sizes of what the stages hand one another: with the device's copy speed,
//! the time below which no frame of this design can come.

/// What a frame is made of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) gaussians: u64,
    pub(crate) pixels: u64,
    pub(crate) views: u64,
    /// (Gaussian, tile) pairs of all views.
    pub(crate) pairs: u64,
}

/// Bytes read and written by the tile back end's frame of a foreground that is all in view. A lower bound: the listing's
/// private counters (a few MB) are left out, and that caches are missed.
pub(crate) fn bytes(frame: Frame) -> u64 {
    let Frame {
        gaussians,
        pixels,
        views,
        pairs,
    } = frame;
    // The host writes 32 bytes a Gaussian.
    let upload = 32;
    // Reads them; writes depth and index (4 + 4), and for each view the splat (32) and the tiles it touches (4).
    let project = 32 + 8 + 36 * views;
    // Count reads depth and index; scatter reads and writes both; ranking reads both and writes the order.
    let sort = 8 + 16 + 12;
    // Both listing passes read the order and each view's tiles.
    let bin = 2 * (4 + 4 * views);
    // The bins, 4 bytes each: cleared, counted, scanned (read and written), read for ranking.
    let bins = 5 * 4 * (gaussians / 4).clamp(1 << 16, 1 << 20).next_power_of_two();
    // A list's entry is written and read; then its splat is read, if not by an early stop.
    let lists = pairs * (4 + 4 + 32);
    // Colour, cleared and then written.
    let picture = 2 * 8 * pixels * views;
    gaussians * (upload + project + sort + bin) + bins + lists + picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_eye_shares_upload_and_sort_but_not_its_picture() {
        let one = Frame {
            gaussians: 100_000,
            pixels: 1 << 20,
            views: 1,
            pairs: 400_000,
        };
        let both = Frame {
            views: 2,
            pairs: 800_000,
            ..one
        };
        let ratio = bytes(both) as f64 / bytes(one) as f64;
        assert!((1.5..2.0).contains(&ratio), "{ratio}");
    }
}
