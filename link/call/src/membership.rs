//! Which keys sit in a call: each member shows its key to the other members by way of the server, with a signature and
//! a proof that it has the call's link. So the server can put no key of its own among them.

use crate::introduction::{self, Authentication};
use crate::{CallError, Credentials};
use identity::{PublicKey, Purpose};
use link_protocol::CallLink;
use link_protocol::calls::{MemberProof, Taken};

/// What this member shows the others; nothing if it would be too long.
pub(crate) fn prove(own: &Credentials, call: &CallLink) -> Option<MemberProof> {
    // Of the call's links only the secret is used, which all seats have.
    let room = call.seat(call.call());
    let lines = introduction::lines(Some(own), &room, Purpose::Member, call.call().as_str());
    MemberProof::try_from(lines).ok()
}

/// The key of the member who sits there; nothing where it shows none.
///
/// # Errors
/// If it does not prove that it has the link, or a signature is wrong.
pub fn key_of(call: &CallLink, taken: &Taken) -> Result<Option<PublicKey>, CallError> {
    let Some(proof) = &taken.proof else {
        return Ok(None);
    };
    let room = call.seat(call.call());
    let text = call.call().as_str();
    Authentication::default().check_sender(&room, Purpose::Member, text, proof.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;
    use identity::Identity;
    use link_protocol::LinkSecret;

    fn call(name: &str, secret: u8) -> CallLink {
        let link = format!("http://127.0.0.1:1/calls/{name}#token");
        let link: CallLink = link.parse().expect("a link");
        link.with_secret(LinkSecret::new([secret; 16]))
    }

    fn sits(proof: Option<MemberProof>) -> Taken {
        let announcement = r#"{"avatar": {"sha256": "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad", "bytes": 3},
            "channel": "unreliable", "codec": "compact", "rate_hz": 30.0}"#;
        Taken {
            announcement: serde_json::from_str(announcement).expect("an announcement"),
            person: None,
            proof,
        }
    }

    #[test]
    fn a_members_key_is_believed_with_its_signature_and_the_calls_link_alone() {
        let ada = Identity::from_seed(&[1; 32]).expect("a key");
        let own = Credentials::new(ada.clone());
        let proof = prove(&own, &call("c1", 1)).expect("short enough");
        let known = key_of(&call("c1", 1), &sits(Some(proof.clone())));
        assert_eq!(known.expect("Ada's"), Some(ada.public()));
        for other in [call("c1", 2), call("c2", 1)] {
            let refused = key_of(&other, &sits(Some(proof.clone())));
            assert!(
                matches!(refused, Err(CallError::NoLink)),
                "{refused:?}, of another call or without the secret"
            );
        }
        let key = |number: u8| Identity::from_seed(&[number; 32]).expect("a key").public();
        let others = String::from(proof).replace(&key(1).to_string(), &key(2).to_string());
        let forged = MemberProof::try_from(others).expect("short enough");
        let refused = key_of(&call("c1", 1), &sits(Some(forged)));
        assert!(
            matches!(refused, Err(CallError::Identity(_))),
            "{refused:?}"
        );
        let nobodys = key_of(&call("c1", 1), &sits(None)).expect("no proof is no wrong one");
        assert_eq!(nobodys, None);
    }
}
