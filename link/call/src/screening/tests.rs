use super::screen::Screen;
use super::sctp::{Association, Verdict};
use super::*;

const HERE: u32 = 0;

fn peer() -> SocketAddr {
    ([192, 0, 2, 1], 5000).into()
}

fn stranger() -> SocketAddr {
    ([192, 0, 2, 1], 5001).into()
}

fn relay() -> SocketAddr {
    ([198, 51, 100, 1], 3478).into()
}

/// A STUN message of this type with these attributes.
fn stun(kind: u16, attributes: &[(u16, &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (kind, value) in attributes {
        body.extend(kind.to_be_bytes());
        body.extend(u16::try_from(value.len()).expect("short").to_be_bytes());
        body.extend(*value);
        body.resize(body.len().next_multiple_of(4), 0);
    }
    let mut message = kind.to_be_bytes().to_vec();
    message.extend(u16::try_from(body.len()).expect("short").to_be_bytes());
    message.extend([
        0x21, 0x12, 0xA4, 0x42, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,
    ]);
    message.extend(body);
    message
}

const REQUEST: u16 = 0x0001;
const SUCCESS: u16 = 0x0101;
const ROLE_CONFLICT: u16 = 0x0111;
const ALLOCATE: u16 = 0x0003;
const CHANNEL_BIND: u16 = 0x0009;
const SEND: u16 = 0x0016;
const DATA: u16 = 0x0017;

/// `XOR-PEER-ADDRESS` of an address of version 4.
fn xor(address: SocketAddr) -> Vec<u8> {
    let SocketAddr::V4(address) = address else {
        panic!("of version 4");
    };
    let mut value = vec![0, 1];
    value.extend((address.port() ^ 0x2112).to_be_bytes());
    value.extend((address.ip().to_bits() ^ 0x2112_A442).to_be_bytes());
    value
}

fn indication(kind: u16, peer: SocketAddr, data: &[u8]) -> Vec<u8> {
    stun(kind, &[(0x0012, &xor(peer)), (0x0013, data)])
}

fn channel(number: u16, data: &[u8]) -> Vec<u8> {
    let mut datagram = number.to_be_bytes().to_vec();
    datagram.extend(u16::try_from(data.len()).expect("short").to_be_bytes());
    datagram.extend(data);
    datagram
}

/// A DTLS record.
fn record(content: u8, epoch: u16, body: &[u8]) -> Vec<u8> {
    let mut record = vec![content, 254, 253];
    record.extend(epoch.to_be_bytes());
    record.extend([0; 6]);
    record.extend(u16::try_from(body.len()).expect("short").to_be_bytes());
    record.extend(body);
    record
}

/// A fragment with as many bytes as it says.
fn fragment(message: u16, length: u32, offset: u32, part: u32) -> Vec<u8> {
    let mut bytes = vec![1];
    bytes.extend(&length.to_be_bytes()[1..]);
    bytes.extend(message.to_be_bytes());
    bytes.extend(&offset.to_be_bytes()[1..]);
    bytes.extend(&part.to_be_bytes()[1..]);
    bytes.resize(bytes.len() + part as usize, 7);
    bytes
}

fn handshake(fragments: &[Vec<u8>]) -> Vec<u8> {
    record(22, 0, &fragments.concat())
}

fn application_data() -> Vec<u8> {
    record(23, 1, &[9; 40])
}

fn rtp(ssrc: u32) -> Vec<u8> {
    let mut packet = vec![0x80, 111, 0, 1, 0, 0, 0, 0];
    packet.extend(ssrc.to_be_bytes());
    packet.extend([5; 20]);
    packet
}

fn rtcp(ssrc: u32) -> Vec<u8> {
    let mut packet = vec![0x80, 201, 0, 1];
    packet.extend(ssrc.to_be_bytes());
    packet.extend([5; 20]);
    packet
}

/// A check of the connection that is described by [`NAME`].
fn check() -> Vec<u8> {
    stun(REQUEST, &[(0x0006, b"here:there")])
}

/// This side's ICE user fragment.
const NAME: &str = "here";

/// The screen of a connection that is described.
fn described() -> Screen {
    let mut screen = Screen::default();
    screen.describe(NAME);
    screen
}

/// A screen that has answered the peer's check.
fn connected() -> Screen {
    let mut screen = described();
    screen.sends(HERE, peer(), &stun(SUCCESS, &[]));
    screen
}

#[test]
fn only_stun_passes_from_sources_that_this_side_has_not_answered() {
    let mut screen = connected();
    let [hello, data, rtp, rtcp] = [
        handshake(&[fragment(0, 40, 0, 40)]),
        application_data(),
        rtp(1),
        rtcp(1),
    ];
    for packet in [&hello, &data, &rtp, &rtcp] {
        assert!(screen.admits(HERE, peer(), packet), "{packet:?}");
        assert!(!screen.admits(HERE, stranger(), packet), "{packet:?}");
    }
    for packet in [check(), stun(SUCCESS, &[]), stun(ROLE_CONFLICT, &[])] {
        assert!(screen.admits(HERE, stranger(), &packet), "{packet:?}");
    }
    for name in ["hers:there", "her:there", "heres", ""] {
        let other = stun(REQUEST, &[(0x0006, name.as_bytes())]);
        assert!(!screen.admits(HERE, peer(), &other), "{name}");
    }
    assert!(!screen.admits(HERE, peer(), &stun(REQUEST, &[])), "unnamed");
    for name in [&b":there"[..], b"", b"here:there"] {
        let early = stun(REQUEST, &[(0x0006, name)]);
        let passes = Screen::default().admits(HERE, peer(), &early);
        assert!(!passes, "{name:?}, before the connection is described");
    }
    // A request of this side, or a refusal, makes no source known.
    for kind in [REQUEST, ROLE_CONFLICT] {
        screen.sends(HERE, stranger(), &stun(kind, &[]));
        assert!(!screen.admits(HERE, stranger(), &data), "{kind}");
    }
    // What this side sends there does: the library sends data only to the selected pair's remote address.
    screen.sends(HERE, stranger(), &data);
    assert!(screen.admits(HERE, stranger(), &data), "the new address");
    assert!(screen.admits(HERE, peer(), &data), "and the one before");
}

#[test]
fn datagrams_of_no_protocol_pass_from_no_source() {
    let mut screen = connected();
    for first in (4..20).chain(24..128).chain(192..=255) {
        let datagram = [&[first][..], &[0; 40]].concat();
        for source in [peer(), stranger()] {
            assert!(!screen.admits(HERE, source, &datagram), "{first}");
        }
    }
    assert!(!screen.admits(HERE, peer(), &[]), "nothing");
}

#[test]
fn no_more_than_64_addresses_of_the_other_side_become_candidates() {
    let mut screen = described();
    let address = |port: u16| SocketAddr::from(([192, 0, 2, 9], port));
    let request = check();
    for port in 1..=64 {
        assert!(screen.admits(HERE, address(port), &request), "{port}");
        screen.sends(HERE, address(port), &stun(SUCCESS, &[]));
    }
    assert!(!screen.admits(HERE, address(65), &request), "one more");
    assert!(screen.admits(HERE, address(1), &request), "a known one");
    assert!(
        screen.admits(HERE, relay(), &stun(SUCCESS, &[])),
        "an answer"
    );
}

#[test]
fn relayed_data_passes_only_from_a_server_with_an_allocation_and_only_of_the_peer() {
    let mut screen = described();
    let data = application_data();
    let from_peer = indication(DATA, peer(), &data);
    assert!(!screen.admits(HERE, relay(), &from_peer), "no allocation");
    screen.sends(HERE, relay(), &stun(ALLOCATE, &[]));
    assert!(!screen.admits(HERE, relay(), &from_peer), "no known peer");
    let check = indication(DATA, peer(), &check());
    assert!(screen.admits(HERE, relay(), &check), "its check");
    screen.sends(
        HERE,
        relay(),
        &indication(SEND, peer(), &stun(SUCCESS, &[])),
    );
    assert!(screen.admits(HERE, relay(), &from_peer), "the answered one");
    let of_other = indication(DATA, stranger(), &data);
    assert!(!screen.admits(HERE, relay(), &of_other), "another's");
    assert!(!screen.admits(HERE, stranger(), &from_peer), "not a server");
    // The peer is known by way of the relay alone.
    assert!(!screen.admits(HERE, peer(), &data), "directly");

    // The same by channels, each of which belongs to one socket.
    assert!(
        !screen.admits(HERE, relay(), &channel(0x4000, &data)),
        "unbound"
    );
    let bind = |number: u16, peer| {
        let number = [&number.to_be_bytes()[..], &[0, 0]].concat();
        stun(CHANNEL_BIND, &[(0x000C, &number), (0x0012, &xor(peer))])
    };
    screen.sends(HERE, relay(), &bind(0x4000, peer()));
    screen.sends(HERE, relay(), &bind(0x4001, stranger()));
    let bound = channel(0x4000, &data);
    assert!(screen.admits(HERE, relay(), &bound), "the peer's");
    assert!(
        !screen.admits(HERE, relay(), &channel(0x4001, &data)),
        "another's"
    );
    assert!(!screen.admits(HERE, stranger(), &bound), "not a server");
    assert!(!screen.admits(1, relay(), &bound), "another socket's");
    // What is answered on a channel is known, too.
    screen.sends(HERE, relay(), &channel(0x4001, &stun(SUCCESS, &[])));
    assert!(
        screen.admits(HERE, relay(), &channel(0x4001, &data)),
        "answered"
    );
    // Messages that say more than they have.
    // Of one byte it is no TURN.
    for cut in 2..from_peer.len() {
        assert!(
            !screen.admits(HERE, relay(), &from_peer[..cut]),
            "{cut} bytes"
        );
    }
    for cut in 0..bound.len() {
        assert!(!screen.admits(HERE, relay(), &bound[..cut]), "{cut} bytes");
    }
}

#[test]
fn relayed_handshakes_have_the_same_bounds() {
    let mut screen = Screen::default();
    screen.sends(HERE, relay(), &stun(ALLOCATE, &[]));
    screen.sends(
        HERE,
        relay(),
        &indication(SEND, peer(), &stun(SUCCESS, &[])),
    );
    let chain = |offset| indication(DATA, peer(), &handshake(&[fragment(0, 9_000, offset, 1)]));
    let admitted = (0..9_000).filter(|&offset| screen.admits(HERE, relay(), &chain(offset)));
    assert_eq!(admitted.count(), 64);
}

/// How many of these datagrams of the peer pass.
fn passing(screen: &mut Screen, datagrams: impl IntoIterator<Item = Vec<u8>>) -> usize {
    let datagrams = datagrams.into_iter();
    let passing = datagrams.filter(|datagram| screen.admits(HERE, peer(), datagram));
    passing.count()
}

#[test]
fn a_message_has_64_fragments_at_most_in_any_order_and_with_any_overlap() {
    let mut random = fastrand::Rng::with_seed(3);
    for variant in 0..4 {
        let mut screen = connected();
        let chain = (0..24_000u32).map(|k| match variant {
            0 => fragment(6, 24_001, k + 1, 1),
            1 => fragment(6, 24_001, 24_000 - k, 1),
            2 => fragment(6, 24_001, random.u32(0..24_000), random.u32(1..2)),
            _ => fragment(6, 24_001, k % 24_000, 1 + k % 2),
        });
        let chain = chain.map(|fragment| handshake(&[fragment]));
        let passed = passing(&mut screen, chain);
        assert!(passed <= 64, "variant {variant}: {passed}");
        // Of other messages there are as many, up to the sixteenth.
        let others = (0..2_000u16).map(|message| handshake(&[fragment(message, 9, 0, 1)]));
        let passed = passing(&mut screen, others);
        assert_eq!(passed, 15, "variant {variant}");
    }
}

#[test]
fn many_fragments_of_one_record_are_many() {
    let mut screen = connected();
    // As a parser that follows the lengths of messages reads them: 110 fragments without a byte, one pointing to the
    // next.
    let heads: Vec<u8> = (1..=110u32)
        .flat_map(|offset| {
            let mut head = fragment(6, 0, offset, 0);
            if let Some(last) = head.last_mut() {
                *last = 1;
            }
            head
        })
        .collect();
    assert!(!screen.admits(HERE, peer(), &record(22, 0, &heads)));
    // As a parser that follows the lengths of fragments does.
    let fragments: Vec<_> = (0..110).map(|offset| fragment(6, 110, offset, 1)).collect();
    assert!(!screen.admits(HERE, peer(), &handshake(&fragments)));
    // Whole messages in a record, and many records in a datagram.
    let whole: Vec<_> = (0..65).map(|_| fragment(0, 2, 0, 2)).collect();
    assert!(!screen.admits(HERE, peer(), &handshake(&whole)));
    let records: Vec<_> = (0..65)
        .map(|_| handshake(&[fragment(1, 2, 0, 2)]))
        .collect();
    assert!(!screen.admits(HERE, peer(), &records.concat()));
}

#[test]
fn fragments_and_records_that_lie_about_their_lengths_do_not_pass() {
    let mut screen = connected();
    for (name, fragments) in [
        ("an empty one of a message", vec![fragment(0, 5, 0, 0)]),
        ("past its message's end", vec![fragment(0, 5, 3, 3)]),
        (
            "whole, and not at the beginning",
            vec![fragment(0, 5, 1, 5)],
        ),
        (
            "before another",
            vec![fragment(0, 5, 0, 1), fragment(0, 5, 1, 4)],
        ),
        ("without a whole head", vec![vec![1, 0, 0]]),
        (
            "longer than its record",
            vec![fragment(0, 9, 0, 9)[..15].to_vec()],
        ),
    ] {
        assert!(
            !screen.admits(HERE, peer(), &handshake(&fragments)),
            "{name}"
        );
    }
    let good = handshake(&[fragment(0, 9, 0, 9)]);
    for cut in 1..good.len() {
        assert!(!screen.admits(HERE, peer(), &good[..cut]), "{cut} bytes");
    }
    let followed = [&good[..], &[22, 254, 253]].concat();
    assert!(
        !screen.admits(HERE, peer(), &followed),
        "half a record more"
    );
    assert!(!screen.admits(HERE, peer(), &record(22, 0, &[])), "empty");
    let mut old = good;
    old[1] = 3;
    assert!(!screen.admits(HERE, peer(), &old), "another version");
}

#[test]
fn before_the_handshake_ends_little_of_the_next_epoch_is_kept() {
    for (content, epoch) in [(22, 1), (23, 1), (21, 1), (20, 0)] {
        let mut screen = connected();
        let records = (0..10_000).map(|_| record(content, epoch, &[1; 40]));
        let passed = passing(&mut screen, records);
        assert_eq!(passed, 64, "content {content} of epoch {epoch}");
    }
    let mut screen = connected();
    let large = (0..100).map(|_| record(23, 1, &[1; 8_000]));
    assert!(passing(&mut screen, large) <= 8, "64 KiB");
    // This side sends data, so its handshake has ended.
    screen.sends(HERE, peer(), &application_data());
    let records = (0..1_000).map(|_| application_data());
    assert_eq!(passing(&mut screen, records), 1_000);
}

#[test]
fn records_of_other_epochs_and_encrypted_handshakes_are_bounded_after_it() {
    let mut screen = connected();
    screen.sends(HERE, peer(), &application_data());
    for (content, epoch) in [(23, 0), (20, 1), (23, 2), (22, 2), (22, 3), (24, 1)] {
        let one = record(content, epoch, &[1; 40]);
        assert!(
            !screen.admits(HERE, peer(), &one),
            "content {content} of epoch {epoch}"
        );
    }
    let large = record(22, 1, &[1; 1_000]);
    assert!(
        !screen.admits(HERE, peer(), &large),
        "a large encrypted one"
    );
    let many = (0..10_000).map(|_| record(22, 1, &[1; 48]));
    assert!(passing(&mut screen, many) <= 64, "encrypted ones");
    assert!(screen.admits(HERE, peer(), &application_data()), "data");
}

/// The flight of a client whose certificate has four fragments.
fn flight() -> [Vec<u8>; 3] {
    let certificate = |offset| fragment(2, 4_000, offset, 1_000);
    [
        [
            handshake(&[certificate(0)]),
            handshake(&[certificate(1_000)]),
        ]
        .concat(),
        [
            handshake(&[certificate(2_000)]),
            handshake(&[certificate(3_000)]),
        ]
        .concat(),
        [
            handshake(&[fragment(3, 66, 0, 66), fragment(4, 78, 0, 78)]),
            record(20, 0, &[1]),
            record(22, 1, &[3; 48]),
        ]
        .concat(),
    ]
}

#[test]
fn an_honest_handshake_passes_with_all_its_repetitions() {
    let mut screen = connected();
    for _ in 0..12 {
        assert!(screen.admits(HERE, peer(), &handshake(&[fragment(0, 150, 0, 150)])));
    }
    for repetition in 0..12 {
        for datagram in flight() {
            assert!(screen.admits(HERE, peer(), &datagram), "{repetition}");
        }
    }
}

#[test]
fn a_connection_has_16_ssrcs_of_each_kind() {
    let mut screen = connected();
    for packet in [rtp, rtcp] {
        assert_eq!(passing(&mut screen, (0..5_000).map(packet)), 16);
        assert!(screen.admits(HERE, peer(), &packet(3)), "a known one");
    }
    for cut in 0..12 {
        assert!(!screen.admits(HERE, peer(), &rtp(3)[..cut]), "{cut} bytes");
    }
}

#[test]
fn a_closed_screen_passes_nothing() {
    let mut screen = connected();
    screen.close();
    for packet in [check(), application_data(), rtp(1)] {
        assert!(!screen.admits(HERE, peer(), &packet));
    }
}

#[test]
fn random_datagrams_are_no_trouble() {
    let mut random = fastrand::Rng::with_seed(7);
    let mut screen = connected();
    screen.sends(HERE, relay(), &stun(ALLOCATE, &[]));
    let begins = [0x00, 0x16, 0x17, 0x40, 0x80, 20, 22, 23];
    for _ in 0..200_000 {
        let mut datagram = match random.u8(0..4) {
            0 => indication(DATA, peer(), &flight()[0]),
            1 => flight()[2].clone(),
            2 => channel(0x4000, &rtp(1)),
            _ => (0..random.usize(0..60)).map(|_| random.u8(..)).collect(),
        };
        for _ in 0..random.usize(0..6) {
            let at = random.usize(0..datagram.len().max(1));
            if let Some(byte) = datagram.get_mut(at) {
                *byte = begins[random.usize(0..begins.len())];
            }
        }
        datagram.truncate(random.usize(0..=datagram.len()));
        let to = [peer(), relay(), stranger()][random.usize(0..3)];
        if random.bool() {
            screen.sends(random.u32(0..2), to, &datagram);
        } else {
            screen.admits(random.u32(0..2), to, &datagram);
        }
    }
}

#[test]
fn of_joined_datagrams_those_that_pass_are_kept() {
    let parts: [&[u8]; 5] = [b"aaa", b"bbb", b"ccc", b"ddd", b"e"];
    for kept in 0..32u32 {
        let mut buffer = parts.concat();
        buffer.extend([0; 9]);
        let mut meta = RecvMeta::default();
        (meta.len, meta.stride) = (13, 3);
        let mut number = 0;
        retain(&mut buffer, &mut meta, |datagram| {
            assert_eq!(datagram, parts[number]);
            number += 1;
            kept >> (number - 1) & 1 == 1
        });
        assert_eq!(number, 5);
        let expected: Vec<&[u8]> = (0..5)
            .filter(|k| kept >> k & 1 == 1)
            .map(|k| parts[k])
            .collect();
        assert_eq!(buffer[..meta.len], expected.concat(), "{kept:b}");
    }
}

/// An SCTP packet of these chunks.
fn sctp(chunks: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut packet = vec![0; 12];
    for (kind, body) in chunks {
        packet.extend([*kind, 7]);
        packet.extend(u16::try_from(body.len() + 4).expect("short").to_be_bytes());
        packet.extend(body);
        packet.resize(packet.len().next_multiple_of(4), 0);
    }
    packet
}

const DATA_CHUNK: u8 = 0;
const INIT_CHUNK: u8 = 1;
const SACK_CHUNK: u8 = 3;
const RE_CONFIG_CHUNK: u8 = 130;
const FORWARD_TSN_CHUNK: u8 = 192;

fn data(number: u32, stream: u16, protocol: u32) -> (u8, Vec<u8>) {
    let (number, stream) = (number.to_be_bytes(), stream.to_be_bytes());
    let protocol = protocol.to_be_bytes();
    let body = [&number[..], &stream, &[0, 0], &protocol, b"hello"].concat();
    (DATA_CHUNK, body)
}

fn sack(number: u32) -> Vec<u8> {
    sctp(&[(SACK_CHUNK, [&number.to_be_bytes()[..], &[0; 8]].concat())])
}

const BINARY: u32 = 53;

#[test]
fn only_messages_of_a_calls_two_channels_pass() {
    for (verdict, stream, protocol) in [
        (Verdict::Passes, 0, BINARY),
        (Verdict::Passes, 1, BINARY),
        (Verdict::Foreign, 2, BINARY),
        (Verdict::Foreign, 65_535, BINARY),
        (Verdict::Foreign, 2, 50),
        (Verdict::Foreign, 0, 50),
    ] {
        let mut association = Association::default();
        // Also behind others.
        let chunks = [
            (SACK_CHUNK, vec![0; 12]),
            data(6, 0, BINARY),
            data(7, stream, protocol),
        ];
        let packet = sctp(&chunks);
        let found = association.verdict(&packet);
        assert_eq!(found, verdict, "{protocol} on stream {stream}");
        for cut in 0..packet.len() {
            association.verdict(&packet[..cut]);
        }
    }
    let mut lies = sctp(&[data(7, 0, BINARY)]);
    lies[15] = 3;
    assert_eq!(Association::default().verdict(&lies), Verdict::Dropped);
}

#[test]
fn data_far_after_what_is_missing_do_not_pass() {
    let passes = |association: &mut Association, number: u32| {
        association.verdict(&sctp(&[data(number, 0, BINARY)])) == Verdict::Passes
    };
    let mut association = Association::default();
    let first = u32::MAX - 500;
    let passed = (0..2_000).filter(|k| passes(&mut association, first.wrapping_add(*k)));
    assert_eq!(passed.count(), 256, "before any is acknowledged");
    association.sends(&sack(first));
    let passed = (1..5_000).filter(|k| passes(&mut association, first.wrapping_add(*k)));
    assert_eq!(passed.count(), 1_024, "after that");
    association.sends(&sack(first.wrapping_add(1_024)));
    assert!(passes(&mut association, first.wrapping_add(1_500)), "more");
    assert!(passes(&mut association, first), "what is repeated");
}

#[test]
fn an_association_begins_and_resets_streams_a_few_times_at_most() {
    for (kind, most) in [(INIT_CHUNK, 16), (RE_CONFIG_CHUNK, 32)] {
        let mut association = Association::default();
        let packet = sctp(&[(kind, vec![1; 16])]);
        let passed = (0..500).filter(|_| association.verdict(&packet) == Verdict::Passes);
        assert_eq!(passed.count(), most, "chunks of type {kind}");
    }
}

#[test]
fn data_are_skipped_only_up_to_a_number_near_the_acknowledged_one() {
    let skip = |number: u32| sctp(&[(FORWARD_TSN_CHUNK, number.to_be_bytes().into())]);
    let mut association = Association::default();
    let first = u32::MAX - 500;
    assert_eq!(
        association.verdict(&skip(first)),
        Verdict::Dropped,
        "too early"
    );
    association.sends(&sack(first));
    for (verdict, ahead) in [
        (Verdict::Passes, 1),
        (Verdict::Passes, 1_024),
        (Verdict::Dropped, 1_025),
        (Verdict::Dropped, (1 << 31) - 1),
    ] {
        let found = association.verdict(&skip(first.wrapping_add(ahead)));
        assert_eq!(found, verdict, "{ahead} ahead");
    }
    let short = sctp(&[(FORWARD_TSN_CHUNK, vec![0; 3])]);
    assert_eq!(association.verdict(&short), Verdict::Dropped, "no number");
}
