//! A server of a test's own, a client, and a sender that reads its presence stream.

use futures_util::StreamExt;
use reqwest::{Client, Method, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use server::{Config, Secret, Server, StoreConfig};
use sha2::{Digest, Sha256};
use std::collections::VecDeque;
use std::error::Error;
use std::net::{IpAddr, SocketAddr};
use std::sync::OnceLock;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use synthetic_person::{Puppet, PuppetSize};
use tempfile::TempDir;
use tokio::net::{TcpSocket, TcpStream};

pub(crate) type Outcome<T = ()> = Result<T, Box<dyn Error + Send + Sync>>;

/// Long enough for a slow machine; whatever takes longer is broken.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

pub(crate) const OFFER: &str = "v=0\r\no=- 1 1 IN IP4 127.0.0.1\r\ns=offer\r\n";
pub(crate) const ANSWER: &str = "v=0\r\no=- 2 1 IN IP4 127.0.0.1\r\ns=answer\r\n";

/// A real avatar package: the synthetic person's.
pub(crate) struct Package {
    pub(crate) bytes: Vec<u8>,
    pub(crate) hash: String,
}

impl Package {
    pub(crate) fn of(bytes: Vec<u8>) -> Self {
        let hash = Sha256::digest(&bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        Self { bytes, hash }
    }

    pub(crate) fn path(&self) -> String {
        format!("/v1/packages/{}", self.hash)
    }
}

pub(crate) fn package() -> &'static Package {
    static PACKAGE: OnceLock<Package> = OnceLock::new();
    PACKAGE.get_or_init(|| {
        let bytes = Puppet::small().avatar().to_bytes();
        Package::of(bytes.expect("the synthetic person makes a package"))
    })
}

/// Another one than [`package`].
pub(crate) fn another_package() -> Package {
    let size = PuppetSize {
        gaussians: 500,
        ..PuppetSize::SMALL
    };
    let bytes = Puppet::new(size).avatar().to_bytes();
    Package::of(bytes.expect("the synthetic person makes a package"))
}

pub(crate) fn unix_now() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_secs())
}

/// A server in this process, on a folder of its own.
pub(crate) struct TestServer {
    pub(crate) server: Server,
    pub(crate) caller: Caller,
    pub(crate) folder: TempDir,
}

impl TestServer {
    pub(crate) async fn start() -> Outcome<Self> {
        Self::start_with(|_| {}).await
    }

    pub(crate) async fn start_with(change: impl FnOnce(&mut Config)) -> Outcome<Self> {
        let folder = tempfile::tempdir()?;
        let mut config = config(StoreConfig::Local(folder.path().to_path_buf()))?;
        change(&mut config);
        let secret = config.secret.clone();
        let server = Server::start(config).await?;
        let caller = Caller::new(server.address(), secret)?;
        Ok(Self {
            server,
            caller,
            folder,
        })
    }

    /// Every file of the store but its lock, by its path below the store's folder.
    pub(crate) fn files(&self) -> Outcome<Vec<String>> {
        files_below(self.folder.path())
    }
}

pub(crate) fn files_below(folder: &std::path::Path) -> Outcome<Vec<String>> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let below = path.strip_prefix(folder)?;
                found.push(below.to_string_lossy().into_owned());
            }
        }
    }
    found.retain(|name| name != "lock");
    found.sort();
    Ok(found)
}

pub(crate) fn config(store: StoreConfig) -> Outcome<Config> {
    Ok(Config {
        listen: SocketAddr::from(([127, 0, 0, 1], 0)),
        store,
        secret: Secret::random()?,
        nats: None,
        forwarding: None,
        stun: Vec::new(),
        turn: None,
        turn_at: None,
        tls: None,
        revoked: None,
        blocked: None,
        limits: server::Limits::default(),
    })
}

/// A client of one server, and the secret that makes it tokens.
#[derive(Clone)]
pub(crate) struct Caller {
    pub(crate) client: Client,
    pub(crate) address: SocketAddr,
    pub(crate) secret: Secret,
    from: Option<[u8; 4]>,
}

/// A room as its owner got it.
#[derive(Clone)]
pub(crate) struct Room {
    pub(crate) id: String,
    pub(crate) sender: String,
    pub(crate) viewer: String,
}

impl Room {
    pub(crate) fn path(&self) -> String {
        format!("/v1/rooms/{}", self.id)
    }
}

impl Caller {
    pub(crate) fn new(address: SocketAddr, secret: Secret) -> Outcome<Self> {
        // The client needs a provider of cryptography, even to speak plain HTTP.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let client = Client::builder().timeout(PATIENCE).build()?;
        Ok(Self {
            client,
            address,
            secret,
            from: None,
        })
    }

    /// The same client at another address of the loopback.
    pub(crate) fn at(&self, from: [u8; 4]) -> Outcome<Self> {
        let client = Client::builder()
            .timeout(PATIENCE)
            .local_address(IpAddr::from(from))
            .build()?;
        Ok(Self {
            client,
            from: Some(from),
            ..self.clone()
        })
    }

    /// A connection of its own.
    pub(crate) async fn connect(&self) -> Outcome<TcpStream> {
        let socket = TcpSocket::new_v4()?;
        if let Some(from) = self.from {
            socket.bind((from, 0).into())?;
        }
        Ok(socket.connect(self.address).await?)
    }

    pub(crate) fn owner(&self, name: &str) -> String {
        self.secret
            .owner_token(name, unix_now() + 3600)
            .expect("random numbers")
    }

    pub(crate) fn request(&self, method: Method, path: &str, token: &str) -> RequestBuilder {
        let url = format!("http://{}{path}", self.address);
        self.client.request(method, url).bearer_auth(token)
    }

    pub(crate) async fn get(&self, path: &str, token: &str) -> Outcome<Response> {
        Ok(self.request(Method::GET, path, token).send().await?)
    }

    pub(crate) async fn put_package(&self, package: &Package, token: &str) -> Outcome<Response> {
        let request = self.request(Method::PUT, &package.path(), token);
        Ok(request.body(package.bytes.clone()).send().await?)
    }

    pub(crate) async fn delete(&self, path: &str, token: &str) -> Outcome<StatusCode> {
        let sent = self.request(Method::DELETE, path, token).send().await?;
        Ok(sent.status())
    }

    /// Puts the package for the owner and opens a room.
    pub(crate) async fn room(&self, owner: &str) -> Outcome<Room> {
        let token = self.owner(owner);
        let put = self.put_package(package(), &token).await?.status();
        assert!(put.is_success(), "the package is stored: {put}");
        self.empty_room(owner).await
    }

    /// As [`Self::room`], for this many seconds.
    pub(crate) async fn room_for(&self, owner: &str, seconds: u64) -> Outcome<Room> {
        self.put_package(package(), &self.owner(owner)).await?;
        self.open(owner, &json!({ "lifetime_s": seconds })).await
    }

    /// Opens a room and puts no package.
    pub(crate) async fn empty_room(&self, owner: &str) -> Outcome<Room> {
        self.open(owner, &json!({})).await
    }

    async fn open(&self, owner: &str, order: &Value) -> Outcome<Room> {
        let token = self.owner(owner);
        let answer = self
            .request(Method::POST, "/v1/rooms", &token)
            .json(order)
            .send()
            .await?;
        assert_eq!(answer.status(), StatusCode::CREATED, "a room is opened");
        let opened: Value = answer.json().await?;
        let text = |key: &str| opened[key].as_str().unwrap_or_default().to_owned();
        Ok(Room {
            id: text("room"),
            sender: text("sender_token"),
            viewer: text("viewer_token"),
        })
    }

    /// Sends an announcement as the room's sender; the answer's body is the stream.
    pub(crate) async fn announce(&self, room: &Room) -> Outcome<Response> {
        let path = format!("{}/presence", room.path());
        let request = self.request(Method::POST, &path, &room.sender);
        // The stream lasts longer than any request.
        let request = request.timeout(Duration::from_secs(3600));
        Ok(request.json(&announcement()).send().await?)
    }

    pub(crate) async fn enter(&self, room: &Room) -> Outcome<Presence> {
        let response = self.announce(room).await?;
        assert_eq!(response.status(), StatusCode::OK, "the sender enters");
        Ok(Presence::new(response))
    }

    /// Joins with the room's viewer token.
    pub(crate) async fn join(&self, room: &Room) -> Outcome<Response> {
        let path = format!("{}/whep", room.path());
        let request = self.request(Method::POST, &path, &room.viewer);
        let request = request.header("content-type", "application/sdp");
        Ok(request.body(OFFER).send().await?)
    }

    /// Answers an offer as the room's sender.
    pub(crate) async fn answer(&self, room: &Room, session: &str) -> Outcome<StatusCode> {
        let path = format!("{}/sessions/{session}/answer", room.path());
        let request = self.request(Method::PUT, &path, &room.sender);
        let request = request.header("content-type", "application/sdp");
        Ok(request.body(ANSWER).send().await?.status())
    }

    /// A viewer joins, the sender answers: returns the session.
    /// A viewer that joined leaves, and the sender gets the event.
    pub(crate) async fn part(
        &self,
        room: &Room,
        session: &str,
        sender: &mut Presence,
    ) -> Outcome<()> {
        let path = format!("{}/sessions/{session}", room.path());
        assert_eq!(
            self.delete(&path, &room.viewer).await?,
            StatusCode::NO_CONTENT,
            "left"
        );
        let told = sender.next().await?;
        assert_eq!(
            told,
            Some(("leave".into(), json!({ "session": session }))),
            "the sender gets the event"
        );
        Ok(())
    }

    pub(crate) async fn meet(&self, room: &Room, sender: &mut Presence) -> Outcome<String> {
        let joining = tokio::spawn({
            let (caller, room) = (self.clone(), room.clone());
            async move { caller.join(&room).await }
        });
        let session = sender.offer().await?;
        assert_eq!(
            self.answer(room, &session).await?,
            StatusCode::NO_CONTENT,
            "the answer is taken"
        );
        let joined = joining.await??;
        assert_eq!(joined.status(), StatusCode::CREATED, "the viewer joins");
        assert_eq!(
            joined.headers()["location"],
            format!("{}/sessions/{session}", room.path()).as_str(),
            "the session's place"
        );
        assert_eq!(joined.text().await?, ANSWER, "the sender's own answer");
        Ok(session)
    }

    /// The number of a line of `/metrics`.
    pub(crate) async fn metric(&self, line: &str) -> Outcome<u64> {
        let text = self.get("/metrics", "").await?.text().await?;
        let found = text.lines().find_map(|l| l.strip_prefix(line));
        Ok(found.map_or(Ok(0), |number| number.trim().parse())?)
    }
}

pub(crate) fn announcement() -> Value {
    let package = package();
    json!({
        "avatar": { "sha256": package.hash, "bytes": package.bytes.len() },
        "channel": "unreliable",
        "codec": "compact",
        "rate_hz": 30.0,
    })
}

/// A sender's stream of events.
pub(crate) struct Presence {
    body: std::pin::Pin<Box<dyn futures_util::Stream<Item = reqwest::Result<bytes::Bytes>> + Send>>,
    text: String,
    told: VecDeque<(String, Value)>,
    pub(crate) comments: usize,
}

impl Presence {
    pub(crate) fn new(response: Response) -> Self {
        Self {
            body: Box::pin(response.bytes_stream()),
            text: String::new(),
            told: VecDeque::new(),
            comments: 0,
        }
    }

    /// The next event, or nothing when the stream has ended. Comments are counted and passed over.
    pub(crate) async fn next(&mut self) -> Outcome<Option<(String, Value)>> {
        loop {
            if let Some(event) = self.told.pop_front() {
                return Ok(Some(event));
            }
            if !self.read().await? {
                return Ok(None);
            }
        }
    }

    /// Reads what comes next. False at the end.
    pub(crate) async fn read(&mut self) -> Outcome<bool> {
        let Some(chunk) = tokio::time::timeout(PATIENCE, self.body.next()).await? else {
            return Ok(false);
        };
        self.text.push_str(std::str::from_utf8(&chunk?)?);
        while let Some((event, rest)) = self.text.split_once("\n\n") {
            let field = |name: &str| event.lines().find_map(|line| line.strip_prefix(name));
            match (field("event: "), field("data: ")) {
                (Some(name), Some(data)) => {
                    self.told
                        .push_back((name.to_owned(), serde_json::from_str(data)?));
                }
                _ => self.comments += 1,
            }
            self.text = rest.to_owned();
        }
        Ok(true)
    }

    /// The servers of the next event, which has to tell some.
    pub(crate) async fn ice_servers(&mut self) -> Outcome<Value> {
        let (name, mut data) = self.next().await?.ok_or("the stream ended")?;
        assert_eq!(name, "ice", "{data}");
        Ok(data["ice_servers"].take())
    }

    /// The session of the next event, which has to be an offer.
    pub(crate) async fn offer(&mut self) -> Outcome<String> {
        let (name, data) = self.next().await?.ok_or("the stream ended")?;
        assert_eq!(name, "offer", "{data}");
        assert_eq!(data["sdp"], OFFER, "the viewer's own offer");
        Ok(data["session"].as_str().unwrap_or_default().to_owned())
    }
}
