//! Combines the settings of all sources, and checks them.

use super::room::{line, read_call_link, read_room_link, read_server};
use super::values::{self, read};
use super::{
    AvatarFile, CertificateFile, DisplayRate, Given, Key, Origin, Problem, Sourced, plain,
};
use app_pipeline::plan::PlacementRequest;
use app_pipeline::timeline::LatencyMode;
use link_protocol::{CallLink, PersonName, ProtocolError, RoomLink};
use log::LevelFilter;
use std::net::SocketAddr;
use std::time::Duration;

/// People that one room of the viewer's is shared with: of the renderer's eight places one is the scenery's.
const MOST_ROOMS: usize = 7;

/// Bytes of packages that are kept.
const CACHE: u64 = 512_000_000;

/// All sources of settings.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    // The strongest first.
    given: Vec<Given>,
    problems: Vec<Problem>,
}

/// The app's task and its checked settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The app's task.
    pub task: Task,
    /// One's own avatar in a call of several.
    pub avatar: Sourced<AvatarFile>,
    /// What others in a call of several read; nothing for the seat's number.
    pub name: Sourced<Option<PersonName>>,
    /// Whether people sit.
    pub seat: Sourced<bool>,
    /// The display's rate; nothing for the one that frames keep up with.
    pub rate: Sourced<Option<DisplayRate>>,
    /// The placement.
    pub placement: Sourced<PlacementRequest>,
    /// Pictures between two motion frames.
    pub latency: Sourced<LatencyMode>,
    /// The log level.
    pub log: Sourced<LevelFilter>,
    /// Bytes of packages that are kept.
    pub cache_bytes: Sourced<u64>,
    /// Certificates of servers that are trusted besides the public ones.
    pub ca: Sourced<Option<CertificateFile>>,
    /// The second screen that is sent where the wearer looks.
    pub gaze_to: Sourced<Option<SocketAddr>>,
}

/// The app's task.
#[derive(Debug, Clone, PartialEq)]
pub enum Task {
    /// Show the people of these rooms, at least one: each a server, a room there, and a viewer's token. A link can hold no more than that.
    Call(Sourced<Vec<RoomLink>>),
    /// Take a seat in this call of several: seen and heard by the others, and shown them.
    Member(Sourced<CallLink>),
    /// Measure the demo person for this long, and write the profile.
    Profile(Sourced<Duration>),
}

impl Sources {
    /// Takes what the intent's extras, its link and the text of `mon3tr.toml` give.
    #[must_use]
    pub fn read<'a>(
        extras: impl IntoIterator<Item = (&'a str, &'a str)>,
        link: Option<&str>,
        file: Option<&str>,
    ) -> Self {
        let mut sources = Self::default();
        sources.given.push(Given::by_intent(extras));
        match link.map(Given::by_link) {
            Some(Ok(given)) => sources.given.push(given),
            Some(Err(problem)) => sources.problems.push(problem),
            None => {}
        }
        match file.map(Given::by_file) {
            Some(Ok(given)) => sources.given.push(given),
            Some(Err(problems)) => sources.problems.extend(problems),
            None => {}
        }
        sources
    }

    /// The same with one more problem, such as a file that cannot be opened.
    #[must_use]
    pub fn with_problem(mut self, problem: Problem) -> Self {
        self.problems.push(problem);
        self
    }

    /// The log level, also where other settings are wrong.
    #[must_use]
    pub fn log_level(&self) -> LevelFilter {
        self.log().map_or(LevelFilter::Info, |level| level.value)
    }

    /// The app's task.
    ///
    /// # Errors
    /// Every problem. The app does not use only the readable sources: one that cannot be read may have been meant to
    /// override them.
    pub fn settings(&self) -> Result<Settings, Vec<Problem>> {
        let mut problems = self.problems.clone();
        let task = keep(self.task(), &mut problems);
        let avatar = self.value(Key::Avatar, AvatarFile::default(), values::avatar);
        let avatar = keep(avatar, &mut problems);
        let name = keep(values::person(self.strongest(Key::Name)), &mut problems);
        let seat = keep(self.value(Key::Seat, false, values::seat), &mut problems);
        let rate = keep(self.value(Key::Rate, None, values::rate), &mut problems);
        let placement = PlacementRequest::default();
        let placement = self.value(Key::Placement, placement, values::placement);
        let placement = keep(placement, &mut problems);
        let latency = self.value(Key::Latency, LatencyMode::default(), values::latency);
        let latency = keep(latency, &mut problems);
        let log = keep(self.log(), &mut problems);
        let cache = self.value(Key::CacheMb, CACHE, values::cache);
        let cache = keep(cache, &mut problems);
        let ca = keep(
            self.value(Key::Ca, None, values::certificates),
            &mut problems,
        );
        let gaze_to = keep(self.gaze_to(), &mut problems);
        match (
            task, avatar, name, seat, rate, placement, latency, log, cache, ca, gaze_to,
        ) {
            (
                Some(task),
                Some(avatar),
                Some(name),
                Some(seat),
                Some(rate),
                Some(placement),
                Some(latency),
                Some(log),
                Some(cache_bytes),
                Some(ca),
                Some(gaze_to),
            ) if problems.is_empty() => Ok(Settings {
                task,
                avatar,
                name,
                seat,
                rate,
                placement,
                latency,
                log,
                cache_bytes,
                ca,
                gaze_to,
            }),
            _ => Err(problems),
        }
    }

    /// Only the file may say it: any app could otherwise learn where the wearer looks.
    fn gaze_to(&self) -> Result<Sourced<Option<SocketAddr>>, Problem> {
        let key = Key::GazeTo;
        match self.strongest(key) {
            Some((origin, _)) if origin > Origin::File => Err(Problem::Value {
                key,
                origin,
                why: "other apps must not be able to ask for it: write it into mon3tr.toml"
                    .to_owned(),
            }),
            given => read(key, given, None, values::gaze_to),
        }
    }

    fn log(&self) -> Result<Sourced<LevelFilter>, Problem> {
        self.value(Key::Log, LevelFilter::Info, values::log_level)
    }

    /// A setting's text in the strongest source that has it.
    fn strongest(&self, key: Key) -> Option<(Origin, &str)> {
        self.given
            .iter()
            .find_map(|given| Some((given.origin(), given.text(key)?)))
    }

    fn value<T>(
        &self,
        key: Key,
        default: T,
        reader: impl FnOnce(&str) -> Result<T, String>,
    ) -> Result<Sourced<T>, Problem> {
        read(key, self.strongest(key), default, reader)
    }

    fn task(&self) -> Result<Task, Problem> {
        // The strongest source counts; what one source says of several, in this order.
        let said = [Key::Profile, Key::Call, Key::Room]
            .into_iter()
            .filter_map(|key| {
                self.strongest(key)
                    .map(|(origin, text)| (key, origin, text))
            })
            .rev()
            .max_by_key(|(_, origin, _)| *origin);
        match said {
            Some((Key::Profile, origin, text)) => {
                let given = Some((origin, text));
                read(Key::Profile, given, Duration::ZERO, values::profile).map(Task::Profile)
            }
            Some((Key::Call, origin, text)) => read_call_link(text)
                .map(|value| Task::Member(Sourced { value, origin }))
                .map_err(|why| Problem::Value {
                    key: Key::Call,
                    origin,
                    why,
                }),
            Some((_, origin, text)) => self.rooms(origin, text).map(Task::Call),
            None => Err(Problem::Missing(Key::Room)),
        }
    }

    fn rooms(&self, origin: Origin, text: &str) -> Result<Sourced<Vec<RoomLink>>, Problem> {
        let wrong = |why| Problem::Value {
            key: Key::Room,
            origin,
            why,
        };
        plain::check(text, Key::Room.longest()).map_err(wrong)?;
        let words: Vec<&str> = text
            .split([' ', ','])
            .filter(|word| !word.is_empty())
            .collect();
        let rooms = match words.as_slice() {
            [] => return Err(Problem::Missing(Key::Room)),
            [name] if !name.contains([':', '/', '#']) => vec![self.named_room(origin, name)?],
            links => {
                if links.len() > MOST_ROOMS {
                    return Err(wrong(format!("there are more than {MOST_ROOMS} rooms")));
                }
                self.check_said_once(origin)?;
                let rooms = links.iter().map(|link| read_room_link(link));
                rooms.collect::<Result<_, _>>().map_err(wrong)?
            }
        };
        Ok(Sourced {
            value: rooms,
            origin,
        })
    }

    /// A whole link from `origin` stands alone; server and token of weaker sources are overridden with their rooms.
    fn check_said_once(&self, origin: Origin) -> Result<(), Problem> {
        for key in [Key::Server, Key::Token] {
            if let Some((other, _)) = self.strongest(key)
                && other >= origin
            {
                return Err(Problem::SaidTwice { key, origin: other });
            }
        }
        Ok(())
    }

    /// A room by its name: server and token stand beside it, or with weaker sources.
    fn named_room(&self, origin: Origin, name: &str) -> Result<RoomLink, Problem> {
        let wrong = |key, origin| move |why| Problem::Value { key, origin, why };
        let missing = |key| self.strongest(key).ok_or(Problem::Missing(key));
        let (of_server, server) = missing(Key::Server)?;
        let server = read_server(server).map_err(wrong(Key::Server, of_server))?;
        let (of_token, token) = missing(Key::Token)?;
        // Any app that can start this one could otherwise have a token sent to its own server.
        if of_token < of_server {
            return Err(Problem::Crossed {
                token: of_token,
                server: of_server,
            });
        }
        plain::check(token, Key::Token.longest()).map_err(wrong(Key::Token, of_token))?;
        RoomLink::of(server, name, token).map_err(|error| match error {
            ProtocolError::Token(_) => wrong(Key::Token, of_token)(line(&error)),
            _ => wrong(Key::Room, origin)(line(&error)),
        })
    }
}

fn keep<T>(read: Result<T, Problem>, problems: &mut Vec<Problem>) -> Option<T> {
    read.map_err(|problem| problems.push(problem)).ok()
}
