//! A server as a process of its own, which can be killed, measured and confined. It is this test program once more,
//! run again with an environment that selects the test below.

use crate::support::{Caller, Outcome, PATIENCE, config};
use serde_json::{Value, json};
use server::{Secret, Server, StoreConfig};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

const ORDERS: &str = "MON3TR_TEST_SERVER";

/// The child's settings.
#[derive(Default)]
pub(crate) struct Orders {
    pub(crate) folder: PathBuf,
    pub(crate) spool: Option<PathBuf>,
    pub(crate) secret: PathBuf,
    /// Bucket and endpoint; instead of the folder.
    pub(crate) s3: Option<(String, String)>,
    pub(crate) nats: Option<String>,
}

/// A process that ends with its test.
pub(crate) struct Process(pub(crate) Child);

impl Process {
    /// Ends it as a power cut would: on Unix this is SIGKILL.
    pub(crate) fn kill_9(&mut self) {
        // An error means that it has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill_9();
    }
}

/// A server in a process of its own.
pub(crate) struct ServerProcess {
    pub(crate) process: Process,
    pub(crate) caller: Caller,
}

impl ServerProcess {
    pub(crate) async fn start(orders: &Orders) -> Outcome<Self> {
        Self::start_within(orders, "exec \"$@\"").await
    }

    /// Starts it from a shell that runs `confine`, which ends in `exec "$@"`.
    pub(crate) async fn start_within(orders: &Orders, confine: &str) -> Outcome<Self> {
        let secret = Secret::load_or_create(&orders.secret)?;
        let told = json!({
            "folder": orders.folder,
            "spool": orders.spool,
            "secret": orders.secret,
            "s3": orders.s3,
            "nats": orders.nats,
        });
        // Not current_exe: where a loader of another place runs the tests, that is the loader.
        let program = std::env::args_os().next().ok_or("no program")?;
        let mut child = Command::new("sh")
            .args(["-c", confine, "sh"])
            .arg(program)
            .args(["--exact", "child::serve", "--ignored", "--nocapture"])
            .env(ORDERS, told.to_string())
            .env("AWS_ACCESS_KEY_ID", "testing")
            .env("AWS_SECRET_ACCESS_KEY", "testing")
            .stdout(Stdio::piped())
            .spawn()?;
        let stdout = child.stdout.take().ok_or("no stdout")?;
        let process = Process(child);
        let (tell, told) = std::sync::mpsc::channel();
        // Its stdout stays open to the end, or it would fail to print.
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                if let Some((_, address)) = line.split_once("listening on ") {
                    let _ = tell.send(address.trim().to_owned());
                }
            }
        });
        let address = told
            .recv_timeout(PATIENCE)
            .map_err(|_| "the server did not start")?;
        let address = address.parse()?;
        Ok(Self {
            process,
            caller: Caller::new(address, secret)?,
        })
    }

    /// The most memory it has had resident, in bytes, if this system tells.
    pub(crate) fn peak_memory(&self) -> Outcome<Option<u64>> {
        let id = self.process.0.id();
        let status = Path::new("/proc").join(id.to_string()).join("status");
        if !status.exists() {
            return Ok(None);
        }
        let text = std::fs::read_to_string(status)?;
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib: u64 = line
            .ok_or("no VmHWM")?
            .trim()
            .trim_end_matches("kB")
            .trim()
            .parse()?;
        Ok(Some(kib << 10))
    }
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "started by other tests, as a process of its own"]
async fn serve() -> Outcome {
    let orders = std::env::var(ORDERS).map_err(|_| "this is for other tests to start")?;
    let orders: Value = serde_json::from_str(&orders)?;
    let text = |key: &str| orders[key].as_str().map(str::to_owned);
    let store = match (orders["s3"][0].as_str(), orders["s3"][1].as_str()) {
        (Some(bucket), Some(endpoint)) => StoreConfig::S3 {
            bucket: bucket.to_owned(),
            endpoint: Some(endpoint.to_owned()),
            region: None,
        },
        _ => StoreConfig::Local(text("folder").ok_or("no folder")?.into()),
    };
    let mut config = config(store)?;
    config.secret = Secret::load_or_create(Path::new(&text("secret").ok_or("no secret")?))?;
    config.nats = text("nats");
    config.limits.spool = text("spool").map(PathBuf::from);
    // Tests poll from one address.
    config.limits.requests_per_second = 0;
    let mut server = Server::start(config).await?;
    println!("listening on {}", server.address());
    server.wait().await?;
    Ok(())
}
