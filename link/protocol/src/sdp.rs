//! Lines that the programs of a call add to offers and answers.

/// `sdp` with `lines` of the whole session, each with its end: before the first medium (RFC 8866, section 5).
#[must_use]
pub fn with_session_lines(sdp: &str, lines: &[&str]) -> String {
    let media = sdp.find("\nm=").map_or(sdp.len(), |at| at + 1);
    let (session, media) = sdp.split_at(media);
    [&[session], lines, &[media]].concat().concat()
}
