use super::*;

/// webrtc-rs 0.21's offer for a data channel, with its host candidates (shape as written by that crate).
const WEBRTC_RS: &str = "v=0\r\n\
o=- 4215775240449105457 1 IN IP4 0.0.0.0\r\n\
s=-\r\n\
t=0 0\r\n\
a=fingerprint:sha-256 D2:5C:8A:26:5B:6B:2B:7B:E4:10:7F:3B:5A:01:11:0D:5E:67:FA:D1:A7:16:D8:10:4A:59:49:A6:2C:7F:6E:0A\r\n\
a=group:BUNDLE 0\r\n\
m=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\n\
c=IN IP4 0.0.0.0\r\n\
a=setup:actpass\r\n\
a=mid:0\r\n\
a=sendrecv\r\n\
a=sctp-port:5000\r\n\
a=ice-ufrag:qvNEVTPCKfBPQOtE\r\n\
a=ice-pwd:tDxSaCcUmsFXQPbhUjbNrGWVnTaLlZEe\r\n\
a=candidate:3350409123 1 udp 2130706431 192.168.7.20 41873 typ host\r\n\
a=candidate:3350409123 2 udp 2130706430 192.168.7.20 41873 typ host\r\n\
a=candidate:2788439512 1 udp 2130706431 127.0.0.1 41873 typ host\r\n\
a=candidate:2788439512 2 udp 2130706430 127.0.0.1 41873 typ host\r\n\
a=end-of-candidates\r\n";

/// aiortc's answer: an audio-less peer connection, IPv4 and IPv6 hosts, and a reflexive candidate from its default STUN server.
const AIORTC: &str = "v=0\r\n\
o=- 3965847291 3965847291 IN IP4 0.0.0.0\r\n\
s=-\r\n\
t=0 0\r\n\
a=group:BUNDLE 0\r\n\
a=msid-semantic:WMS *\r\n\
m=application 46154 UDP/DTLS/SCTP webrtc-datachannel\r\n\
c=IN IP6 fd00::5\r\n\
a=mid:0\r\n\
a=sctp-port:5000\r\n\
a=max-message-size:65536\r\n\
a=candidate:0d9cbd2ba1a0a5e1fa34cb65ea4c7a18 1 udp 2130706431 fd00::5 46154 typ host\r\n\
a=candidate:9a1a7a2fcbd4ae3c1bd7e0e43a0a5d1c 1 udp 2130706431 10.1.2.3 37812 typ host\r\n\
a=candidate:55a0f8d42c1e07b8b3b7a2f0f4a9ac2d 1 udp 1694498815 203.0.113.9 37812 typ srflx raddr 10.1.2.3 rport 37812\r\n\
a=end-of-candidates\r\n\
a=ice-ufrag:hB5f\r\n\
a=ice-pwd:kq8pPqNn0TVY4B2FzYbzxI\r\n\
a=fingerprint:sha-256 6B:8B:5D:0A:97:2E:F0:0A:6C:94:2E:55:6D:5C:4E:13:AA:F9:5B:3E:5F:2A:AE:97:90:1D:67:F5:1C:68:41:2B\r\n\
a=setup:active\r\n";

/// Chromium's offer with mDNS names, TCP candidates, and a second, bundled section without candidates.
const CHROMIUM: &str = "v=0\r\n\
o=- 6043532317046212811 2 IN IP4 127.0.0.1\r\n\
s=-\r\n\
t=0 0\r\n\
a=group:BUNDLE 0 1\r\n\
a=extmap-allow-mixed\r\n\
a=msid-semantic: WMS\r\n\
m=application 56143 UDP/DTLS/SCTP webrtc-datachannel\r\n\
c=IN IP4 198.51.100.7\r\n\
a=candidate:1510613869 1 udp 2113937151 3f1c5b0a-77ce-4a37-9d4a-0a8f4ce60b41.local 56143 typ host generation 0 network-cost 999\r\n\
a=candidate:842163049 1 udp 1677729535 198.51.100.7 56143 typ srflx raddr 0.0.0.0 rport 0 generation 0 network-cost 999\r\n\
a=candidate:344579997 1 tcp 1518280447 3f1c5b0a-77ce-4a37-9d4a-0a8f4ce60b41.local 9 typ host tcptype active generation 0 network-cost 999\r\n\
a=ice-ufrag:NHmX\r\n\
a=ice-pwd:1qnM+R2O3jH2uY3V7uUmlr2d\r\n\
a=ice-options:trickle\r\n\
a=fingerprint:sha-256 3A:71:2D:F5:50:DB:0F:3A:7D:85:66:4C:2E:8B:19:F8:1C:F5:A9:2E:C0:36:5E:E1:E7:7A:35:1A:C9:0D:2F:44\r\n\
a=setup:actpass\r\n\
a=mid:0\r\n\
a=sctp-port:5000\r\n\
a=max-message-size:262144\r\n\
m=audio 9 UDP/TLS/RTP/SAVPF 111\r\n\
c=IN IP4 0.0.0.0\r\n\
a=rtcp:9 IN IP4 0.0.0.0\r\n\
a=ice-ufrag:NHmX\r\n\
a=mid:1\r\n\
a=recvonly\r\n\
a=rtpmap:111 opus/48000/2\r\n";

const LAB: &str = "127.0.0.1:40001";

fn lab() -> SocketAddr {
    LAB.parse().expect("an address")
}

fn led(sdp: &str) -> Rewritten {
    rewrite(sdp, lab()).expect("a good description")
}

/// Lines that say nothing of addresses, which must come through as they are.
fn untouched(sdp: &str) -> Vec<&str> {
    sdp.split("\r\n")
        .filter(|l| {
            !["a=candidate", "m=", "c=", "a=rtcp:"]
                .iter()
                .any(|p| l.starts_with(p))
        })
        .collect()
}

fn candidates(sdp: &str) -> Vec<&str> {
    sdp.lines()
        .filter(|l| l.starts_with("a=candidate:"))
        .collect()
}

#[test]
fn every_description_leads_to_the_lab_alone_and_is_otherwise_unchanged() {
    for (name, sdp) in [
        ("webrtc-rs", WEBRTC_RS),
        ("aiortc", AIORTC),
        ("Chromium", CHROMIUM),
    ] {
        let led = led(sdp).sdp;
        assert_eq!(untouched(&led), untouched(sdp), "{name}");
        let [candidate] = candidates(&led)[..] else {
            panic!("{name}: one candidate is due, not {:?}", candidates(&led));
        };
        assert!(
            candidate.contains(" 1 udp ") && candidate.contains(" 127.0.0.1 40001 typ host"),
            "{name}: {candidate}"
        );
        assert!(
            !candidate.contains("raddr") && !led.contains(".local") && !led.contains("198.51."),
            "{name}: an address is left in {led}"
        );
        assert!(
            led.contains(
                "m=application 40001 UDP/DTLS/SCTP webrtc-datachannel\r\nc=IN IP4 127.0.0.1\r\n"
            ),
            "{name}: {led}"
        );
        assert_eq!(
            rewrite(&led, lab()).expect("still good").sdp,
            led,
            "{name}: a second time changes nothing"
        );
    }
}

#[test]
fn the_authors_address_is_the_nearest_candidate() {
    let of = |sdp| led(sdp).peer.map(|a| a.to_string());
    assert_eq!(
        of(WEBRTC_RS).as_deref(),
        Some("127.0.0.1:41873"),
        "the loopback first"
    );
    assert_eq!(
        of(AIORTC).as_deref(),
        Some("10.1.2.3:37812"),
        "IPv4 before IPv6"
    );
    assert_eq!(of(CHROMIUM), None, "a name tells no address");
}

#[test]
fn a_candidate_keeps_its_other_fields() {
    let led = led(CHROMIUM).sdp;
    assert_eq!(
        candidates(&led),
        [
            "a=candidate:1510613869 1 udp 2113937151 127.0.0.1 40001 typ host generation 0 network-cost 999"
        ],
        "foundation, priority and extensions"
    );
}

#[test]
fn other_sections_follow_the_bundle() {
    let led = led(CHROMIUM).sdp;
    assert!(
        led.contains("m=audio 40001 UDP/TLS/RTP/SAVPF 111\r\nc=IN IP4 127.0.0.1\r\na=rtcp:40001 IN IP4 127.0.0.1\r\n"),
        "{led}"
    );
    let refused = CHROMIUM.replace("m=audio 9 ", "m=audio 0 ");
    let led = rewrite(&refused, lab()).expect("still good").sdp;
    assert!(
        led.contains("m=audio 0 "),
        "a refused section stays refused: {led}"
    );
}

#[test]
fn a_description_without_candidates_is_given_one() {
    let bare: String = CHROMIUM
        .split_inclusive("\r\n")
        .filter(|l| !l.starts_with("a=candidate:"))
        .collect();
    let led = led(&bare);
    assert_eq!(led.peer, None, "no address was found");
    assert_eq!(candidates(&led.sdp).len(), 1, "{}", led.sdp);
    let (first, _) = led.sdp.split_once("m=audio").expect("two sections");
    assert_eq!(candidates(first).len(), 1, "in the first section");
}

#[test]
fn line_ends_stay_the_same() {
    let unix = AIORTC.replace("\r\n", "\n");
    assert!(!led(&unix).sdp.contains('\r'), "LF stays LF");
    assert_eq!(
        led(&unix).sdp,
        led(AIORTC).sdp.replace("\r\n", "\n"),
        "and only that differs"
    );
}

#[test]
fn a_text_that_is_no_description_is_refused() {
    for bad in [
        "",
        "hello",
        "v=0\r\ns=-\r\n",
        "v=0\r\nm=application\r\n",
        "{\"sdp\": \"v=0\"}",
    ] {
        assert!(
            matches!(rewrite(bad, lab()), Err(NetlabError::Sdp(_))),
            "{bad:?}"
        );
    }
    // Half a candidate line is no candidate, and does not get through either.
    let broken = WEBRTC_RS.replace("typ host", "typ");
    let led = led(&broken);
    assert_eq!(led.peer, None, "nothing to go by");
    assert_eq!(candidates(&led.sdp).len(), 1, "{}", led.sdp);
}
