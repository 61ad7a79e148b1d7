//! Guests' links: a token of their own, and who they are, for one room.

use link_call::{CallError, Credentials, Door};
use link_http::Client;
use link_protocol::{Guest, PersonName, Rights, RoomLink, Token};
use std::str::FromStr;
use std::time::Duration;

/// The longest time that may be asked for.
const LONGEST: Duration = Duration::from_secs(30 * 86_400);

/// Whom a sender invites, for how long, and to what: `NAME[,TIME][,see|hear]`, the time as `90m`, `12h` or `7d`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Invitation {
    /// What the sender calls them.
    pub name: PersonName,
    /// How long the link holds; nothing for as long as the room.
    pub lifetime: Option<Duration>,
    /// What they may have.
    pub rights: Rights,
}

impl FromStr for Invitation {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(',').map(str::trim);
        let name = parts.next().unwrap_or_default();
        let mut invitation = Self {
            name: name
                .parse()
                .map_err(|_| format!("{name:?} is no name of 1 to 40 characters"))?,
            lifetime: None,
            rights: Rights::ALL,
        };
        for part in parts {
            let rights = match part {
                "see" => Some((true, false)),
                "hear" => Some((false, true)),
                _ => None,
            };
            match rights {
                Some((see, hear)) if invitation.rights == Rights::ALL => {
                    invitation.rights = Rights { see, hear };
                }
                None if invitation.lifetime.is_none() => {
                    invitation.lifetime = Some(time(part)?);
                }
                _ => return Err(format!("{part:?} is one too many: NAME[,TIME][,see|hear]")),
            }
        }
        Ok(invitation)
    }
}

/// `90m`, `12h`, `7d`.
fn time(text: &str) -> Result<Duration, String> {
    let unit = |unit: char| match unit {
        'm' => Some(60),
        'h' => Some(3_600),
        'd' => Some(86_400),
        _ => None,
    };
    let seconds = text.chars().next_back().and_then(unit);
    let number = text.get(..text.len().saturating_sub(1));
    let number: Option<u64> = number.and_then(|number| number.parse().ok());
    let time = number.zip(seconds);
    let time = time.and_then(|(number, seconds)| number.checked_mul(seconds));
    time.map(Duration::from_secs)
        .filter(|time| !time.is_zero() && *time <= LONGEST)
        .ok_or_else(|| format!("{text:?} is neither `see` nor `hear` nor a time like 90m, 12h or 7d, of 30 days at most"))
}

/// The link of a guest to the sender's `room`, whose server makes a token for them alone. The door knows of it from then on.
///
/// # Errors
/// If the server makes none, or too many guests have links.
pub async fn invite(
    client: &Client,
    room: &RoomLink,
    own: &Credentials,
    door: &Door,
    invitation: &Invitation,
) -> Result<RoomLink, CallError> {
    let added = client.add_viewer(room, invitation.lifetime).await?;
    let guest = Guest {
        name: invitation.name.clone(),
        expires: added.expires,
        rights: invitation.rights,
        token: added.name,
    };
    door.invite(guest.clone())?;
    let pass = own.pass(room.room(), guest);
    let token = Token::new(&added.viewer_token)?;
    let keyed = room.clone().with_key(own.key().hash());
    Ok(keyed.for_guest(token, pass))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_invitation_says_who_how_long_and_to_what() {
        let read = |text: &str| text.parse::<Invitation>();
        let bob = read("Bob").expect("a name");
        assert_eq!((bob.lifetime, bob.rights), (None, Rights::ALL));
        let zoe = read("Zo\u{eb} Q, see, 90m").expect("all three");
        assert_eq!(zoe.name.as_str(), "Zo\u{eb} Q");
        assert_eq!(zoe.lifetime, Some(Duration::from_secs(5_400)));
        let sees = Rights {
            see: true,
            hear: false,
        };
        assert_eq!(zoe.rights, sees);
        let day = read("Bob,1d").expect("a day");
        assert_eq!(day.lifetime, Some(Duration::from_secs(86_400)));
        for wrong in [
            "",
            ",1h",
            "Bob,",
            "Bob,0m",
            "Bob,31d",
            "Bob,m",
            "Bob,1w",
            "Bob,1h,2h",
            "Bob,see,hear",
            "Bob,\u{e4}",
            "Bob,99999999999999999999h",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
