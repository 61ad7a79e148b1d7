//! Where a headset's wearer looks, told to a second screen: a line of JSON a frame, each in a UDP datagram of its own (`docs/call-reference.md`).
//!
//! A line is what `--gaze` reads: `{"seconds":S,"eye":[x,y,z],"towards":[x,y,z]}`, the place between the wearer's eyes and a point a metre from it on
//! their line of sight, metres in the motion space of the first person who is shown (y up, +z to their front). UDP, because an old gaze is worth
//! nothing: what is lost is not sent again.

use app_session::headset::{GazeListener, WearerView};
use glam::{Affine3A, Vec3};
use motion_fit::wearer::LEAST_GAZE_CONFIDENCE;
use std::fmt;
use std::io::{Cursor, ErrorKind, Write};
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Bytes of the longest line: six coordinates within a kilometre, and a time of years.
const LONGEST: usize = 192;

/// A screen that is not there for so long is told of.
const PATIENCE: Duration = Duration::from_secs(5);

/// Refusals that are further apart are not of one absence.
const REFUSED_AGAIN: Duration = Duration::from_secs(1);

/// Sends gazes to one address.
#[derive(Debug)]
pub struct GazeFeed {
    socket: UdpSocket,
    to: SocketAddr,
    began: Instant,
    told: Mutex<Told>,
}

/// Lines that were sent.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct Sent {
    /// All of them.
    pub lines: u64,
    /// Those that follow the wearer's eyes, and not the head alone.
    pub by_eyes: u64,
}

/// What was said of how it goes.
#[derive(Debug, Default)]
struct Told {
    sent: Sent,
    has_failed: bool,
    /// When it was said first and last that nobody is there, while nobody is.
    refused: Option<[Instant; 2]>,
    has_told_refused: bool,
}

/// Why gazes cannot be sent.
#[derive(Debug, thiserror::Error)]
pub enum GazeFeedError {
    /// The address is none.
    #[error(
        "{address} is no address to send a gaze to ({why}): give a host and a port, like 192.168.1.20:7215"
    )]
    Address {
        /// As it was given.
        address: String,
        /// What is wrong.
        why: String,
    },
    /// There is no socket for it.
    #[error("cannot send a gaze to {to}")]
    Socket {
        /// The address.
        to: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
}

impl GazeFeed {
    /// The address of a host and a port: its IPv4 one, which screens listen to, where it has both.
    ///
    /// # Errors
    /// If it is none.
    pub fn resolve(address: &str) -> Result<SocketAddr, GazeFeedError> {
        let not_one = |why: String| GazeFeedError::Address {
            address: address.to_owned(),
            why,
        };
        let found = address.to_socket_addrs();
        let found = found.map_err(|error| not_one(error.to_string()))?;
        match found.min_by_key(SocketAddr::is_ipv6) {
            Some(to) if to.port() != 0 => Ok(to),
            Some(_) => Err(not_one("ports are 1 to 65535".to_owned())),
            None => Err(not_one("no such host".to_owned())),
        }
    }

    /// To this address. Nothing is sent before a frame has a person in it.
    ///
    /// # Errors
    /// If this machine has no way there.
    pub fn new(to: SocketAddr) -> Result<Self, GazeFeedError> {
        let socket = || {
            let socket = if to.is_ipv4() {
                UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))
            } else {
                UdpSocket::bind((Ipv6Addr::UNSPECIFIED, 0))
            }?;
            socket.connect(to)?;
            socket.set_nonblocking(true)?;
            Ok(socket)
        };
        Ok(Self {
            socket: socket().map_err(|source| GazeFeedError::Socket { to, source })?,
            to,
            began: Instant::now(),
            told: Mutex::default(),
        })
    }

    /// Where it goes.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.to
    }

    /// What was sent so far.
    #[must_use]
    pub fn sent(&self) -> Sent {
        self.told
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .sent
    }

    /// Says how it goes, once each.
    fn tell(&self, sent: std::io::Result<usize>, by_eyes: bool) {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let to = self.to;
        match sent.map_err(|error| (error.kind(), error)) {
            Ok(_) => {
                if told.sent.lines == 0 {
                    log::info!("where the wearer looks is sent to {to}");
                }
                told.sent.lines += 1;
                told.sent.by_eyes += u64::from(by_eyes);
            }
            // Each other datagram of those to a machine where nobody listens.
            Err((ErrorKind::ConnectionRefused, _)) => {
                let now = Instant::now();
                let goes_on = |[_, last]: &[Instant; 2]| now - *last < REFUSED_AGAIN;
                let first = told.refused.filter(goes_on).map_or(now, |[first, _]| first);
                told.refused = Some([first, now]);
                if now - first > PATIENCE && !std::mem::replace(&mut told.has_told_refused, true) {
                    log::warn!(
                        "nobody takes where the wearer looks at {to}: is --gaze udp:{} there?",
                        to.port()
                    );
                }
            }
            // The network is busy; the next one is newer.
            Err((ErrorKind::WouldBlock, _)) => {}
            Err((_, error)) => {
                if !std::mem::replace(&mut told.has_failed, true) {
                    log::warn!("where the wearer looks cannot be sent to {to}: {error}");
                }
            }
        }
    }
}

impl GazeListener for GazeFeed {
    fn looked(&self, view: &WearerView) {
        let (sight, by_eyes) = LineOfSight::of(view);
        let line = Line {
            seconds: self.began.elapsed().as_secs_f64(),
            sight,
        };
        let mut bytes = [0; LONGEST];
        let mut to = Cursor::new(&mut bytes[..]);
        // A place that is no number, or a million kilometres away, is none.
        if !line.sight.is_finite() || write!(to, "{line}").is_err() {
            return;
        }
        let length = usize::try_from(to.position()).unwrap_or(LONGEST);
        let line = bytes.get(..length).unwrap_or_default();
        self.tell(self.socket.send(line), by_eyes);
    }
}

/// From where to where the wearer looks, in a person's motion space, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LineOfSight {
    eye: Vec3,
    towards: Vec3,
}

impl LineOfSight {
    /// Both eyes together, if one at least is surely tracked, and else as the head is turned; and whether it is the eyes'.
    fn of(view: &WearerView) -> (Self, bool) {
        let person_from_floor = view.floor_from_person.inverse();
        let ahead = |pose: &Affine3A| -Vec3::from(pose.matrix3.z_axis);
        let sure = (view.gazes.iter().flatten())
            .filter(|gaze| gaze.confidence >= LEAST_GAZE_CONFIDENCE)
            .map(|gaze| ahead(&gaze.floor_from_eye));
        let eye = Vec3::from(view.floor_from_head.translation);
        // Eyes that look opposite ways look nowhere.
        let both = Some(sure.sum::<Vec3>()).filter(|sum| sum.length() > 0.5);
        let direction =
            (both.unwrap_or_else(|| ahead(&view.floor_from_head))).normalize_or(Vec3::NEG_Z);
        let sight = Self {
            eye: person_from_floor.transform_point3(eye),
            towards: person_from_floor.transform_point3(eye + direction),
        };
        (sight, both.is_some())
    }

    fn is_finite(&self) -> bool {
        self.eye.is_finite() && self.towards.is_finite()
    }
}

struct Line {
    seconds: f64,
    sight: LineOfSight,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [e, t] = [self.sight.eye, self.sight.towards];
        write!(
            f,
            "{{\"seconds\":{:.6},\"eye\":[{:.4},{:.4},{:.4}],\"towards\":[{:.4},{:.4},{:.4}]}}",
            self.seconds, e.x, e.y, e.z, t.x, t.y, t.z
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use renderer_openxr::ext::eye_tracking::Gaze;
    use std::f32::consts::PI;
    use std::time::Duration;

    /// A wearer at the origin who looks along -z at a person 1.6 m before them, who faces them.
    fn view() -> WearerView {
        WearerView {
            floor_from_head: Affine3A::from_translation(Vec3::new(0.2, 1.6, 0.0)),
            gazes: [None; 2],
            floor_from_person: Affine3A::from_translation(Vec3::new(0.0, 0.0, -1.6)),
        }
    }

    fn gaze(yaw: f32, confidence: f32) -> Option<Gaze> {
        Some(Gaze {
            floor_from_eye: Affine3A::from_rotation_y(yaw),
            confidence,
        })
    }

    fn direction(view: &WearerView) -> Vec3 {
        let (sight, _) = LineOfSight::of(view);
        sight.towards - sight.eye
    }

    #[test]
    fn the_wearer_is_told_as_the_person_sees_them() {
        let (sight, by_eyes) = LineOfSight::of(&view());
        assert!(!by_eyes, "none are tracked");
        let expected = [Vec3::new(0.2, 1.6, 1.6), Vec3::new(0.2, 1.6, 0.6)];
        assert!(sight.eye.abs_diff_eq(expected[0], 1e-5), "{sight:?}");
        assert!(sight.towards.abs_diff_eq(expected[1], 1e-5), "{sight:?}");
        // Of a person who has turned their back, the wearer is behind, and to the other side.
        let turned = WearerView {
            floor_from_person: view().floor_from_person
                * Affine3A::from_quat(Quat::from_rotation_y(PI)),
            ..view()
        };
        let eye = LineOfSight::of(&turned).0.eye;
        assert!(eye.abs_diff_eq(Vec3::new(-0.2, 1.6, -1.6), 1e-5), "{eye}");
    }

    #[test]
    fn eyes_that_are_surely_tracked_are_followed_and_else_the_head() {
        let with = |gazes| direction(&WearerView { gazes, ..view() });
        let ahead = direction(&view());
        // Turns about y to the left are positive: -x.
        let both = with([gaze(0.3, 1.0), gaze(0.1, 0.9)]);
        let left = (-both.x).atan2(-both.z);
        assert!((left - 0.2).abs() < 1e-3, "the mean of both: {left}");
        let one = with([gaze(0.3, 1.0), gaze(-1.0, LEAST_GAZE_CONFIDENCE / 2.0)]);
        let left = (-one.x).atan2(-one.z);
        assert!((left - 0.3).abs() < 1e-3, "the sure one: {left}");
        for none in [[gaze(0.3, 0.0), None], [gaze(0.0, 1.0), gaze(PI, 1.0)]] {
            assert!(with(none).abs_diff_eq(ahead, 1e-3), "{none:?}");
        }
    }

    /// A screen, and what sends to it.
    fn screen() -> (UdpSocket, GazeFeed) {
        let screen = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
        let longest = Duration::from_secs(5);
        screen.set_read_timeout(Some(longest)).expect("a limit");
        let feed = GazeFeed::new(screen.local_addr().expect("bound")).expect("a way");
        (screen, feed)
    }

    fn next(screen: &UdpSocket) -> (serde_json::Value, usize) {
        let mut bytes = [0; 512];
        let length = screen.recv(&mut bytes).expect("a datagram");
        let line = serde_json::from_slice(&bytes[..length]);
        (line.expect("JSON"), length)
    }

    #[test]
    fn each_frame_is_a_datagram_with_a_line_of_json() {
        let (screen, feed) = screen();
        let mut last = -1.0;
        for _ in 0..3 {
            feed.looked(&view());
            let (line, length) = next(&screen);
            let seconds = line["seconds"].as_f64().expect("a time");
            assert!(seconds > last, "{line}");
            last = seconds;
            assert_eq!(line["eye"][2], 1.6, "{line}");
            assert_eq!(line["towards"][2], 0.6, "{line}");
            // With the headers of UDP, IP and Ethernet.
            let kbit_s = |hz: usize| (length + 8 + 20 + 18) * 8 * hz / 1000;
            assert!(feed.sent().lines > 0 && feed.sent().by_eyes == 0);
            assert!(length <= 96, "{length} bytes");
            println!(
                "{length} bytes: {} kbit/s at 72 Hz, {} at 120",
                kbit_s(72),
                kbit_s(120)
            );
        }
    }

    #[test]
    fn a_place_that_is_none_is_not_sent() {
        let (screen, feed) = screen();
        for x in [1e30, f32::NAN, f32::INFINITY, 0.25] {
            feed.looked(&WearerView {
                floor_from_head: Affine3A::from_translation(Vec3::splat(x)),
                ..view()
            });
        }
        assert_eq!(next(&screen).0["eye"][0], 0.25, "the only one");
    }

    #[test]
    fn a_screen_that_is_not_there_is_waited_for_and_an_address_that_is_none_is_refused() {
        let (screen, feed) = screen();
        let address = screen.local_addr().expect("bound");
        drop(screen);
        for _ in 0..4 {
            feed.looked(&view());
        }
        let screen = UdpSocket::bind(address).expect("the same port");
        let longest = Duration::from_millis(100);
        screen.set_read_timeout(Some(longest)).expect("a limit");
        let came = (0..50).any(|_| {
            feed.looked(&view());
            screen.recv(&mut [0; 512]).is_ok()
        });
        assert!(came, "once it is there");
        let error = GazeFeed::resolve("192.168.1.20").expect_err("no port");
        assert!(error.to_string().contains("192.168.1.20:7215"), "{error}");
        let here = GazeFeed::resolve("localhost:7215").expect("an address");
        assert!(here.is_ipv4(), "{here}");
        let zero = GazeFeed::resolve("127.0.0.1:0").expect_err("no port");
        assert!(zero.to_string().contains("1 to 65535"), "{zero}");
    }
}
