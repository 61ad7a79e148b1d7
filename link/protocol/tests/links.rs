//! Reading room links, package hashes and announcements, and what is refused.

use std::fs;

use link_codec::Codec;
use link_protocol::announcement::{AvatarRef, ChannelMode};
use link_protocol::room_link::ServerUrl;
use link_protocol::{Announcement, PackageId, ProtocolError, RoomLink};

const ID: &str = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

#[test]
fn a_link_is_printed_as_it_was_read() {
    for text in [
        "http://127.0.0.1:8480/rooms/aB3-_x#v1.t~o-k/e+n==",
        "https://call.example/rooms/R#t",
        "https://call.example:444/under/a/path/rooms/R#t",
        "http://[::1]:8480/rooms/rooms#t",
        "https://call.example/rooms/rooms/R#t",
    ] {
        let link: RoomLink = text.parse().expect(text);
        assert_eq!(link.to_string(), text, "the whole link");
        assert_eq!(
            format!(" {text}\n")
                .parse::<RoomLink>()
                .expect("with blanks around"),
            link,
            "the same"
        );
    }
    let link: RoomLink = "https://h/pre/rooms/R7#secret".parse().expect("a link");
    assert_eq!(
        (link.server().to_string(), link.room().as_str()),
        ("https://h/pre".to_owned(), "R7"),
        "its parts"
    );
    assert_eq!(
        format!("{link:?}"),
        "https://h/pre/rooms/R7#...",
        "Debug hides the token"
    );
}

#[test]
fn a_text_that_is_no_link_is_refused_with_the_reason() {
    for (text, why) in [
        ("https://h/rooms/R", "#TOKEN"),
        ("https://h/rooms/R#", "empty"),
        ("https://h/rooms/R#secret token", "character"),
        ("https://h/rooms/R#secret\u{e4}", "character"),
        ("https://h/room/R#secret", "/rooms/ROOM"),
        ("https://h/rooms/#secret", "room's name"),
        ("https://h/rooms/..#secret", "room's name"),
        ("https://h/rooms/a%2fb#secret", "room's name"),
        ("https://h/rooms/a?b#secret", "room's name"),
        ("h:8480/rooms/R#secret", "http://"),
        ("/rooms/R#secret", "http://"),
        ("ftp://h/rooms/R#secret", "http://"),
        ("https://me:secret@h/rooms/R#secret", "user name"),
        ("https://h:99999/rooms/R#secret", "port"),
        ("https:///rooms/R#secret", "no room link"),
        (
            &format!("https://h/rooms/R#{}", "s".repeat(5000)),
            "too long",
        ),
        (
            &format!("https://{}/rooms/R#secret", "h".repeat(9000)),
            "too long",
        ),
    ] {
        let error = text.parse::<RoomLink>().expect_err(text).to_string();
        assert!(error.contains(why), "`{text}`: {error}");
        assert!(
            error.contains("/rooms/ROOM#TOKEN") && !error.contains("secret"),
            "`{text}`: {error}"
        );
    }
}

#[test]
fn a_servers_address_holds_no_token_query_or_user() {
    for (text, printed) in [
        ("https://h/", "https://h"),
        ("http://h:8480/a/b/", "http://h:8480/a/b"),
    ] {
        assert_eq!(
            text.parse::<ServerUrl>().expect(text).to_string(),
            printed,
            "without its last slash"
        );
    }
    for text in [
        "",
        "h:80",
        "file:///etc/passwd",
        "https://h/#t",
        "https://h/?q",
        "https://u@h/",
    ] {
        assert!(
            matches!(text.parse::<ServerUrl>(), Err(ProtocolError::Address(_))),
            "`{text}` is refused"
        );
    }
}

#[test]
fn a_package_is_called_by_its_sha256() {
    // FIPS 180-2, appendix B.1.
    assert_eq!(
        PackageId::of_bytes(b"abc").to_string(),
        ID,
        "the standard's example"
    );
    assert_eq!(
        ID.parse::<PackageId>().expect("an id"),
        PackageId::of_bytes(b"abc"),
        "read back"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("abc");
    fs::write(&path, b"abc").expect("written");
    let of_file = AvatarRef::of_file(&path).expect("read");
    assert_eq!(
        (of_file.sha256.to_string().as_str(), of_file.bytes),
        (ID, 3),
        "of a file"
    );
    assert!(
        matches!(
            AvatarRef::of_file(folder.path()),
            Err(ProtocolError::File { .. })
        ),
        "a folder is no file"
    );
    let upper = ID.to_uppercase();
    for text in [
        "",
        "abc",
        &ID[1..],
        &format!("{ID}0"),
        upper.as_str(),
        &format!("../{}", &ID[3..]),
        &"\u{e4}".repeat(32),
    ] {
        assert!(
            matches!(text.parse::<PackageId>(), Err(ProtocolError::PackageId)),
            "`{text}` is refused"
        );
    }
}

#[test]
fn an_announcement_is_read_as_the_protocol_writes_it_and_only_within_bounds() {
    let text = |bytes: &str, channel: &str, codec: &str, rate: &str| {
        format!(
            r#"{{"avatar":{{"sha256":"{ID}","bytes":{bytes}}},"channel":"{channel}","codec":"{codec}","rate_hz":{rate},"later":1}}"#
        )
    };
    let read: Announcement = serde_json::from_str(&text("16800000", "reliable", "paper", "30"))
        .expect("as in the protocol");
    assert_eq!(
        (read.channel, read.codec, read.rate_hz),
        (ChannelMode::Reliable, Codec::Paper, 30.0),
        "its values"
    );
    let again: Announcement =
        serde_json::from_str(&serde_json::to_string(&read).expect("JSON")).expect("read back");
    assert_eq!(again, read, "written and read back");
    for (bytes, channel, codec, rate) in [
        ("0", "reliable", "paper", "30"),
        ("-1", "reliable", "paper", "30"),
        ("99999999999", "reliable", "paper", "30"),
        ("1", "Reliable", "paper", "30"),
        ("1", "reliable", "morse", "30"),
        ("1", "reliable", "paper", "0.5"),
        ("1", "reliable", "paper", "241"),
        ("1", "reliable", "paper", "1e999"),
        ("1", "reliable", "paper", "null"),
    ] {
        let text = text(bytes, channel, codec, rate);
        assert!(
            serde_json::from_str::<Announcement>(&text).is_err(),
            "{text}"
        );
    }
    assert!(
        Announcement {
            rate_hz: f64::NAN,
            ..read
        }
        .checked()
        .is_err(),
        "no rate at all"
    );
    for word in ["reliable", "unreliable"] {
        assert_eq!(
            word.parse::<ChannelMode>().expect("a channel").to_string(),
            word,
            "printed as read"
        );
    }
}

#[test]
fn a_calls_link_where_a_rooms_is_needed_says_what_joins_it() {
    let error = "http://example.org/calls/c1#secret".parse::<RoomLink>();
    let said = error.expect_err("no room's").to_string();
    assert!(said.contains("mon3tr call LINK"), "{said}");
    assert!(!said.contains("secret"), "{said}");
}
