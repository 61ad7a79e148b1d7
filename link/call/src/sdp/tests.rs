//! Descriptions of several programs, hidden lines, and what the WebRTC library reads of what is written for it.

use super::*;
use crate::candidates::screened;
use ring::digest;
use rtc::sdp::description::session::SessionDescription;
use std::io::Cursor;

/// A certificate's fingerprint that begins so.
pub(crate) fn fingerprint(begins: &str) -> String {
    format!("{begins}{}", ":5A".repeat(30))
}

/// An offer of one section of data channels, with these lines in it.
pub(crate) fn offer(lines: &str) -> String {
    let fingerprint = fingerprint("AA:01");
    format!(
        "v=0\r\no=- 7 2 IN IP4 127.0.0.1\r\ns=-\r\nt=0 0\r\na=group:BUNDLE 0\r\na=fingerprint:sha-256 {fingerprint}\r\n\
         m=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\nc=IN IP4 0.0.0.0\r\na=ice-ufrag:abcd\r\n\
         a=ice-pwd:abcdefghijklmnopqrstuv\r\na=setup:actpass\r\na=mid:0\r\na=sctp-port:5000\r\n{lines}"
    )
}

/// As Chromium 126 offers it, but for some of its codecs.
const CHROMIUM: &str = "v=0\r\no=- 4611731400430051336 2 IN IP4 127.0.0.1\r\ns=-\r\nt=0 0\r\na=group:BUNDLE 0 1\r\na=extmap-allow-mixed\r\n\
a=msid-semantic: WMS\r\nm=application 55432 UDP/DTLS/SCTP webrtc-datachannel\r\nc=IN IP4 203.0.113.5\r\n\
a=candidate:2999745851 1 udp 2113937151 8d5b5f3e-0000-4000-8000-1c6a0f8b2d11.local 55432 typ host generation 0 network-cost 999\r\n\
a=candidate:842163049 1 udp 1677729535 203.0.113.5 55432 typ srflx raddr 0.0.0.0 rport 0 generation 0 network-cost 999\r\n\
a=ice-ufrag:4ZcD\r\na=ice-pwd:2/1muCWoOi3uLifh0NuRHlcW\r\na=ice-options:trickle\r\na=fingerprint:sha-256 \
AA:01:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A\r\n\
a=setup:actpass\r\na=mid:0\r\na=sctp-port:5000\r\na=max-message-size:262144\r\n\
m=audio 9 UDP/TLS/RTP/SAVPF 111 63 0\r\nc=IN IP4 0.0.0.0\r\na=rtcp:9 IN IP4 0.0.0.0\r\na=ice-ufrag:4ZcD\r\n\
a=ice-pwd:2/1muCWoOi3uLifh0NuRHlcW\r\na=ice-options:trickle\r\na=fingerprint:sha-256 \
AA:01:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A\r\n\
a=setup:actpass\r\na=mid:1\r\na=extmap:1 urn:ietf:params:rtp-hdrext:ssrc-audio-level\r\na=recvonly\r\na=rtcp-mux\r\na=rtcp-rsize\r\n\
a=rtpmap:111 opus/48000/2\r\na=rtcp-fb:111 transport-cc\r\na=fmtp:111 minptime=10;useinbandfec=1\r\na=rtpmap:63 red/48000/2\r\n\
a=fmtp:63 111/111\r\na=rtpmap:0 PCMU/8000\r\n";

/// As Firefox offers it.
const FIREFOX: &str = "v=0\r\no=mozilla...THIS_IS_SDPARTA-99.0 8747331180526151318 0 IN IP4 0.0.0.0\r\ns=-\r\nt=0 0\r\na=fingerprint:sha-256 \
AA:01:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A:5A\r\n\
a=group:BUNDLE 0\r\na=ice-options:trickle\r\na=msid-semantic:WMS *\r\nm=application 50000 UDP/DTLS/SCTP webrtc-datachannel\r\n\
c=IN IP4 203.0.113.5\r\na=candidate:0 1 UDP 2122252543 0f5f33ad-68fd-4d2f-9ec2-6b0fc5c3ba0f.local 50000 typ host\r\n\
a=candidate:1 1 TCP 2105524479 0f5f33ad-68fd-4d2f-9ec2-6b0fc5c3ba0f.local 9 typ host tcptype active\r\n\
a=candidate:2 1 UDP 1685987327 203.0.113.5 50000 typ srflx raddr 0.0.0.0 rport 0\r\na=sendrecv\r\na=end-of-candidates\r\n\
a=ice-pwd:0c2f0b6e2c7b5a1f9e8d7c6b5a493827\r\na=ice-ufrag:a1b2c3d4\r\na=mid:0\r\na=setup:actpass\r\na=sctp-port:5000\r\n\
a=max-message-size:1073741823\r\n";

/// What the library makes of text that it gets: every certificate, and the addresses.
fn read_by_the_library(text: &str) -> (Vec<String>, Vec<String>) {
    let read = SessionDescription::unmarshal(&mut Cursor::new(text)).expect("the library reads it");
    let sections = read
        .media_descriptions
        .iter()
        .map(|section| &section.attributes);
    let all: Vec<_> = std::iter::once(&read.attributes)
        .chain(sections)
        .flatten()
        .collect();
    let value = |name: &str| {
        let named = all
            .iter()
            .filter(|it| it.key.trim().eq_ignore_ascii_case(name));
        named.filter_map(|it| it.value.clone()).collect()
    };
    (value("fingerprint"), value("candidate"))
}

/// That the library sees of `text` the certificate and the addresses that were checked; whether `text` is taken at all.
fn assert_one_reading(text: &str) -> bool {
    let Ok(description) = Description::read(text) else {
        return false;
    };
    let tried = screened(&description.candidates, false);
    let Ok(written) = description.write(tried.clone()) else {
        return false;
    };
    let (certificates, candidates) = read_by_the_library(&written);
    let signed = description
        .fingerprints()
        .expect("it is written")
        .to_string();
    assert!(!certificates.is_empty(), "{written}");
    for certificate in certificates {
        let certificate = certificate.to_ascii_lowercase();
        assert!(
            signed.split(',').any(|it| it == certificate),
            "{certificate} is not in {signed}"
        );
    }
    let tried: Vec<String> = tried.iter().map(|it| it.to_string()).collect();
    assert_eq!(candidates, tried, "{text}");
    for candidate in candidates {
        let read = rtc::ice::candidate::unmarshal_candidate(&candidate);
        assert!(read.is_ok(), "{candidate}: {read:?}");
    }
    true
}

#[test]
fn offers_of_browsers_are_read_as_the_library_reads_what_is_written_of_them() {
    for (text, candidates, tried) in [(CHROMIUM, 2, 2), (FIREFOX, 3, 2), (&offer(""), 0, 0)] {
        let description = Description::read(text).expect("an offer");
        let signed = format!("sha-256 {}", fingerprint("aa:01").to_lowercase());
        assert_eq!(description.fingerprints().expect("one").to_string(), signed);
        assert_eq!(description.candidates.len(), candidates, "{text}");
        assert_eq!(
            screened(&description.candidates, false).len(),
            tried,
            "{text}"
        );
        assert!(assert_one_reading(text), "{text}");
        let bare = text.replace("\r\n", "\n");
        assert_eq!(Description::read(&bare), Ok(description), "LF alone");
    }
}

/// What a server in the middle puts before the genuine line, with a blank, a tab, a line end, a control character or
/// one of Unicode's blanks at each place.
fn hidden(line: &str) -> Vec<String> {
    let (name, value) = line.split_once(':').expect("an attribute");
    let name = name.strip_prefix("a=").expect("an attribute");
    let signs = [
        " ", "\t", "\r", "\u{a0}", "\u{0c}", "\u{0b}", "\0", "\u{85}", "\u{2003}", "\u{2028}",
        "\u{feff}", "\u{1b}", "\u{7f}", "\u{202f}",
    ];
    let mut hidden: Vec<String> = (signs.iter())
        .flat_map(|sign| {
            [
                format!("{sign}a={name}:{value}"),
                format!("a{sign}={name}:{value}"),
                format!("a={sign}{name}:{value}"),
            ]
        })
        .collect();
    hidden.push(format!("A={name}:{value}"));
    hidden.push(format!("\na={name}:{value}"));
    hidden.push(format!("\r\na={name}:{value}"));
    hidden.push(format!("a=x\ra={name}:{value}"));
    hidden.push(format!("=a={name}:{value}"));
    hidden.push(format!("aa={name}:{value}"));
    hidden
}

#[test]
fn a_line_that_only_one_reader_understands_is_refused_at_every_place() {
    let evil = format!("a=fingerprint:sha-256 {}", fingerprint("CC:03"));
    let address = "a=candidate:1 1 udp 1 203.0.113.66 5000 typ host".to_owned();
    for genuine in [CHROMIUM, FIREFOX, &offer("")] {
        assert!(Description::read(genuine).is_ok());
        let ends: Vec<usize> = genuine
            .match_indices("\r\n")
            .map(|(at, _)| at + 2)
            .collect();
        for line in hidden(&evil).into_iter().chain(hidden(&address)) {
            for at in std::iter::once(0).chain(ends.iter().copied()) {
                let text = format!("{}{line}\r\n{}", &genuine[..at], &genuine[at..]);
                let read = Description::read(&text);
                assert!(
                    matches!(read, Err(SdpError::Line { .. })),
                    "{line:?} at {at}: {read:?}"
                );
            }
        }
    }
}

#[test]
fn a_second_certificate_is_refused_wherever_it_is() {
    let other = |name: &str, length: usize| {
        format!("a=fingerprint:{name} CC{}\r\n", ":03".repeat(length - 1))
    };
    for genuine in [CHROMIUM, FIREFOX, &offer("")] {
        let ends: Vec<usize> = genuine
            .match_indices("\r\n")
            .map(|(at, _)| at + 2)
            .collect();
        for at in ends {
            for line in [
                other("sha-256", 32),
                other("SHA-256", 32),
                other("sha-256", 31),
                other("sha-1", 20),
                other("md5", 16),
            ] {
                let text = format!("{}{line}{}", &genuine[..at], &genuine[at..]);
                assert!(Description::read(&text).is_err(), "{line} at {at}");
            }
        }
    }
    // Two hash functions of one certificate, as aiortc writes them, may stand beside one another.
    let both = offer(&other("sha-512", 64));
    let signed = Description::read(&both).expect("an offer");
    let signed = signed.fingerprints().expect("one").to_string();
    assert!(
        signed.starts_with("sha-256 aa:01") && signed.contains(",sha-512 cc:03"),
        "{signed}"
    );
    let without = offer("").replace("sha-256", "sha-512");
    assert!(
        Description::read(&without).is_err(),
        "a length of another hash function"
    );
}

#[test]
fn a_certificate_is_compared_by_every_hash_function_that_was_signed() {
    let der = b"a certificate";
    let of = |hash: &'static digest::Algorithm, name: &str, der: &[u8]| {
        let digest = digest::digest(hash, der);
        let pairs: Vec<String> = digest
            .as_ref()
            .iter()
            .map(|byte| format!("{byte:02X}"))
            .collect();
        format!("a=fingerprint:{name} {}\r\n", pairs.join(":"))
    };
    let signed = |lines: &[String]| {
        let text = format!("v=0\r\n{}", lines.concat());
        Description::read(&text)
            .expect("a description")
            .fingerprints
            .clone()
    };
    let genuine = of(&digest::SHA256, "sha-256", der);
    let long = |der: &[u8]| of(&digest::SHA512, "sha-512", der);
    assert!(signed(std::slice::from_ref(&genuine)).are_of(der));
    assert!(signed(&[genuine.clone(), long(der)]).are_of(der));
    assert!(
        !signed(&[genuine.clone(), long(b"another")]).are_of(der),
        "both have to be of it"
    );
    assert!(!signed(&[genuine]).are_of(b"another"));
    assert!(!signed(&[long(der)]).are_of(der), "SHA-256 is always there");
    assert!(!signed(&[]).are_of(der), "no fingerprint is of any");
}

#[test]
fn attributes_of_the_session_are_there_once_and_in_no_section() {
    for name in [
        "mon3tr-link:x",
        "mon3tr-key:x",
        "mon3tr-permit:x",
        "mon3tr-guest:x",
        "mon3tr-name:x",
        "mon3tr-forwarder",
        "mon3tr-refused:link",
    ] {
        let line = format!("a={name}\r\n");
        let before = |lines: &str| offer("").replacen("m=app", &format!("{lines}m=app"), 1);
        assert!(Description::read(&before(&line)).is_ok(), "{name}");
        assert!(
            Description::read(&before(&[line.clone(), line.clone()].concat())).is_err(),
            "{name} twice"
        );
        assert!(
            Description::read(&offer(&line)).is_err(),
            "{name} in a section"
        );
    }
    for twice in [
        "a=mid:1",
        "a=sctp-port:5001",
        "a=ice-ufrag:other",
        "a=ice-pwd:another0another0another0",
        "a=setup:active",
        "v=0",
    ] {
        assert!(
            Description::read(&offer(&format!("{twice}\r\n"))).is_err(),
            "{twice}"
        );
    }
}

#[test]
fn the_size_of_a_description_is_bounded() {
    let lines = |count: usize| offer(&"a=x\r\n".repeat(count));
    assert!(Description::read(&lines(400)).is_ok());
    assert!(Description::read(&lines(600)).is_err(), "lines");
    let long = |length: usize| offer(&format!("a={}\r\n", "x".repeat(length)));
    assert!(Description::read(&long(900)).is_ok());
    assert!(Description::read(&long(1100)).is_err(), "a line");
    assert!(
        Description::read(&offer(
            &"m=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\n".repeat(8)
        ))
        .is_err(),
        "sections"
    );
    for text in [
        "",
        "\r\n",
        "v=0",
        "v=1\r\n",
        "o=- 1 1 IN IP4 0.0.0.0\r\nv=0\r\n",
    ] {
        assert!(Description::read(text).is_err(), "{text:?}");
    }
}

#[test]
fn a_description_without_what_a_connection_needs_is_not_written() {
    for missing in ["a=ice-ufrag", "a=ice-pwd", "a=setup", "a=fingerprint", "m="] {
        let text: String = (offer("").split_inclusive("\r\n"))
            .filter(|line| !line.starts_with(missing))
            .collect();
        let read = Description::read(&text);
        let written = read.and_then(|it| it.write(&[]));
        assert!(written.is_err(), "{missing}: {written:?}");
    }
    let refusal = Description::read(&Refusal::Locked.answer()).expect("a refusal");
    assert_eq!(refusal.refusal, Some(Refusal::Locked));
}

#[test]
fn whatever_passes_is_read_by_the_library_as_it_was_checked() {
    let mut random = fastrand::Rng::with_seed(7);
    let evil = format!("a=fingerprint:sha-256 {}\r\n", fingerprint("CC:03"));
    let pieces = [
        " ",
        "\t",
        "\r",
        "\n",
        "\r\n",
        "\0",
        "\u{a0}",
        "\u{0b}",
        "\u{0c}",
        "\u{85}",
        "\u{2028}",
        ":",
        "=",
        "a=",
        "m=",
        "v=0\r\n",
        "0",
        &evil,
        "a=candidate:9 1 udp 9 203.0.113.9 9 typ host\r\n",
        "a=inactive\r\n",
        "m=audio 9 UDP/TLS/RTP/SAVPF 0\r\n",
        "a=ice-lite\r\n",
    ];
    let (mut taken, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let genuine = random.choice([CHROMIUM, FIREFOX]).expect("two");
        let mut text = genuine.to_owned();
        for _ in 0..random.usize(1..4) {
            let mut at = random.usize(0..=text.len());
            while !text.is_char_boundary(at) {
                at -= 1;
            }
            // Half of the changes are where a line begins.
            if random.bool() {
                at = text[..at].rfind('\n').map_or(0, |at| at + 1);
            }
            match random.u8(0..3) {
                0 => text.insert_str(at, random.choice(pieces).expect("a piece")),
                1 => {
                    text.truncate(at);
                    text.push_str(genuine.get(at..).unwrap_or_default());
                }
                _ if at < text.len() => drop(text.remove(at)),
                _ => {}
            }
        }
        if assert_one_reading(&text) {
            taken += 1;
        } else {
            refused += 1;
        }
    }
    println!("{taken} taken, {refused} refused");
    assert!(taken > 1_000 && refused > 1_000, "{taken} and {refused}");
}
