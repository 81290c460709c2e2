//! The configuration file.

use crate::failure::Failure;
use crate::topics;
use pitchleak::live::{BatchFormat, LiveConfig, LiveDocument};
use serde::Deserialize;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// All that the service runs by, files read.
#[derive(Debug)]
pub struct Config {
    pub watch: LiveConfig,
    /// Folder of checkpoints and summaries.
    pub state: PathBuf,
    /// Time between two checkpoints.
    pub checkpoint: Duration,
    pub broker: BrokerConfig,
    pub samples: Vec<Samples>,
    /// Topics of what is published begin with it.
    pub base: String,
    /// Where metrics and health are told; nowhere, if none.
    pub listen: Option<SocketAddr>,
}

/// How to reach the broker.
#[derive(Debug)]
pub struct BrokerConfig {
    pub host: String,
    pub port: u16,
    pub client_id: String,
    /// Without it the connection is open to whoever listens.
    pub tls: Option<Tls>,
    pub login: Option<Login>,
    pub keep_alive_s: u16,
    /// Deliveries that the broker leaves unacknowledged at most before it waits.
    pub in_flight: usize,
    /// Messages that the broker shall keep while the gateway is away, which is found out at the start; 0: it is not.
    pub queued: usize,
}

#[derive(Debug)]
pub enum Tls {
    /// The authority's certificate, PEM.
    Authority(Vec<u8>),
    /// The system's authorities.
    System,
}

#[derive(Clone)]
pub struct Login {
    pub user: String,
    pub password: String,
}

impl std::fmt::Debug for Login {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Login").field("user", &self.user).finish_non_exhaustive()
    }
}

/// Where samples come from.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Samples {
    /// Topic filter; the levels of `+` and `#` name the cylinder.
    pub topic: String,
    pub format: BatchFormat,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    state: PathBuf,
    checkpoint_s: Option<f64>,
    broker: BrokerDocument,
    samples: Vec<Samples>,
    #[serde(default)]
    publish: Publish,
    #[serde(default)]
    http: Http,
    watch: LiveDocument,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BrokerDocument {
    host: String,
    port: Option<u16>,
    client_id: Option<String>,
    tls: Option<bool>,
    ca_file: Option<PathBuf>,
    user: Option<String>,
    password_file: Option<PathBuf>,
    keep_alive_s: Option<u16>,
    in_flight: Option<u16>,
    queued: Option<u32>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Publish {
    base: Option<String>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Http {
    listen: Option<String>,
}

/// Mosquitto's own limit, unless its configuration says otherwise.
const IN_FLIGHT: u16 = 20;
/// As many messages are sent to find out whether the broker keeps them.
const MOST_QUEUED: u32 = 100_000;

impl Config {
    /// Reads the file at `path`, and those that it names; paths in it are from its folder.
    pub fn load(path: &Path) -> Result<Self, Failure> {
        let text = String::from_utf8(read(path)?).map_err(|_| Failure::content(path, "not UTF-8"))?;
        let document: Document = toml::from_str(&text)
            .map_err(|error| Failure::content(path, error.to_string().trim().replace('\n', " ")))?;
        let bad = |why: String| Failure::content(path, why);
        let checkpoint_s = document.checkpoint_s.unwrap_or(10.0);
        if !(0.1..=3600.0).contains(&checkpoint_s) {
            return Err(bad(format!("checkpoint_s = {checkpoint_s}: 0.1 to 3600 is allowed")));
        }
        let base = document.publish.base.unwrap_or_else(|| "pitchleak".to_owned());
        if base.is_empty() || base.contains(['+', '#', '\0']) {
            return Err(bad(format!("publish.base = {base:?}: a topic without + and # is expected")));
        }
        if document.samples.is_empty() {
            return Err(bad("no [[samples]]: nothing would be listened to".to_owned()));
        }
        for Samples { topic, .. } in &document.samples {
            if !topics::is_filter(topic) {
                return Err(bad(format!("samples.topic = {topic:?} is no topic filter")));
            }
            let probe = topics::of_cylinder(&base, "a/b", "estimate");
            if topics::cylinder_of(topic, &probe).is_some() || topic == "#" {
                return Err(bad(format!(
                    "samples.topic = {topic:?} takes in what is published under {base:?}"
                )));
            }
        }
        let listen = match document.http.listen.as_deref().unwrap_or("127.0.0.1:9465") {
            "" => None,
            address => Some(address.parse().map_err(|_| bad(format!("http.listen = {address:?}: an address and a port such as \"127.0.0.1:9465\" is expected, or \"\" for none")))?),
        };
        Ok(Self {
            watch: document.watch.load(path)?,
            state: beside(path, &document.state),
            checkpoint: Duration::from_secs_f64(checkpoint_s),
            broker: document.broker.load(path)?,
            samples: document.samples,
            base,
            listen,
        })
    }
}

impl BrokerDocument {
    fn load(self, path: &Path) -> Result<BrokerConfig, Failure> {
        let bad = |why: &str| Failure::content(path, why);
        let tls = match (self.tls.unwrap_or(true), self.ca_file) {
            (false, Some(_)) => return Err(bad("broker.ca_file is of no use where tls = false")),
            (false, None) => None,
            (true, Some(file)) => Some(Tls::Authority(certificate(&beside(path, &file))?)),
            (true, None) => Some(Tls::System),
        };
        let login = match (self.user, self.password_file) {
            (Some(user), Some(file)) => Some(Login { user, password: secret(&beside(path, &file))? }),
            (None, None) => None,
            _ => return Err(bad("broker.user and broker.password_file belong together")),
        };
        let client_id = self.client_id.unwrap_or_else(|| "pitchleak-gateway".to_owned());
        if client_id.is_empty() || self.host.is_empty() || self.in_flight == Some(0) {
            return Err(bad("broker: host and client_id must not be empty, nor in_flight 0"));
        }
        let queued = self.queued.unwrap_or(0);
        if queued > MOST_QUEUED {
            return Err(bad(&format!("broker.queued = {queued}: at most {MOST_QUEUED} is allowed")));
        }
        Ok(BrokerConfig {
            host: self.host,
            port: self.port.unwrap_or(if tls.is_some() { 8883 } else { 1883 }),
            client_id,
            tls,
            login,
            keep_alive_s: self.keep_alive_s.unwrap_or(30).max(1),
            in_flight: self.in_flight.unwrap_or(IN_FLIGHT).into(),
            queued: queued as usize,
        })
    }
}

fn beside(config: &Path, file: &Path) -> PathBuf {
    config.parent().unwrap_or(Path::new("")).join(file)
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    std::fs::read(path).map_err(|source| Failure::Read { path: path.to_owned(), source })
}

fn certificate(path: &Path) -> Result<Vec<u8>, Failure> {
    let bytes = read(path)?;
    if String::from_utf8_lossy(&bytes).contains("-----BEGIN CERTIFICATE-----") {
        return Ok(bytes);
    }
    Err(Failure::content(path, "no certificate in PEM"))
}

/// Its one line.
fn secret(path: &Path) -> Result<String, Failure> {
    let text = String::from_utf8(read(path)?).map_err(|_| Failure::content(path, "not UTF-8"))?;
    match text.lines().next() {
        Some(line) if !line.is_empty() => Ok(line.to_owned()),
        _ => Err(Failure::content(path, "no password in its first line")),
    }
}
