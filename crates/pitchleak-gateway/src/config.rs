//! The configuration file; certificates, keys and passwords that it names are read from their files, and who else could read
//! them is said.

use crate::{Failure, topics};
use pitchleak::live::{BatchFormat, LiveConfig, LiveDocument};
use serde::Deserialize;
use std::net::SocketAddr;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// All that the service runs by, files read. It has secrets: nothing here is `Debug`.
#[derive(Clone, PartialEq)]
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
    /// Where metrics, health and the page are told; nowhere, if none.
    pub listen: Option<SocketAddr>,
    /// A cylinder of which nothing comes for so long is silent.
    pub silent_after: Duration,
    /// How often the file is looked at; none: when a signal asks for it.
    pub reload_every: Option<Duration>,
    /// What whoever set it up should know.
    pub warnings: Vec<String>,
}

/// How to reach the broker.
#[derive(Clone, PartialEq, Eq)]
pub struct BrokerConfig {
    pub host: String,
    pub port: u16,
    pub client_id: String,
    /// Without it the connection is open to whoever listens.
    pub tls: Option<Tls>,
    pub login: Option<Login>,
    pub keep_alive_s: u16,
    /// Deliveries after which the broker waits for us; none: as many as MQTT 5 allows.
    pub in_flight: Option<u16>,
}

/// How the connection is hidden from others.
#[derive(Clone, PartialEq, Eq)]
pub struct Tls {
    /// The authority's certificate, PEM; none: the system's authorities.
    pub authority: Option<Vec<u8>>,
    /// Who we are, to a broker that wants to know.
    pub identity: Option<Identity>,
}

/// Where samples come from.
#[derive(Clone, PartialEq, Eq, Deserialize)]
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
    reload_every_s: Option<f64>,
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
    client_cert_file: Option<PathBuf>,
    client_key_file: Option<PathBuf>,
    user: Option<String>,
    password_file: Option<PathBuf>,
    keep_alive_s: Option<u16>,
    in_flight: Option<u16>,
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
    silent_after_s: Option<f64>,
}

impl Config {
    /// Reads the file at `path`, and those that it names; paths in it are from its folder.
    pub fn load(path: &Path) -> Result<Self, Failure> {
        let text = String::from_utf8(read(path)?).map_err(|_| Failure::content(path, "not UTF-8"))?;
        let document: Document = toml::from_str(&text)
            .map_err(|error| Failure::content(path, error.to_string().trim().replace('\n', " ")))?;
        let bad = |why: String| Failure::content(path, why);
        let seconds = |name: &str, value: f64, least: f64, most: f64| match value {
            value if (least..=most).contains(&value) => Ok(Duration::from_secs_f64(value)),
            value => Err(bad(format!("{name} = {value}: {least} to {most} is allowed"))),
        };
        let checkpoint = seconds("checkpoint_s", document.checkpoint_s.unwrap_or(10.0), 0.1, 3600.0)?;
        let silent_after =
            seconds("http.silent_after_s", document.http.silent_after_s.unwrap_or(60.0), 1.0, 1e7)?;
        let reload_every = document
            .reload_every_s
            .map(|value| seconds("reload_every_s", value, 1.0, 86_400.0))
            .transpose()?;
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
        let mut files = Files { config: path, warnings: Vec::new() };
        if let Some(address) = listen.filter(|address: &SocketAddr| !address.ip().is_loopback()) {
            files.warnings.push(format!(
                "http.listen = \"{address}\": whoever reaches it reads the page and the metrics"
            ));
        }
        Ok(Self {
            watch: document.watch.load(path)?,
            state: files.path(&document.state)?,
            checkpoint,
            broker: document.broker.load(&mut files)?,
            samples: document.samples,
            base,
            listen,
            silent_after,
            reload_every,
            warnings: files.warnings,
        })
    }

    /// What another configuration has otherwise and a running service cannot change.
    pub fn needs_a_start(&self, other: &Self) -> Vec<&'static str> {
        [
            ("state", self.state == other.state),
            ("broker", self.broker == other.broker),
            ("samples", self.samples == other.samples),
            ("publish", self.base == other.base),
            ("http", (self.listen, self.silent_after) == (other.listen, other.silent_after)),
        ]
        .into_iter()
        .filter_map(|(name, same)| (!same).then_some(name))
        .collect()
    }
}

impl BrokerDocument {
    fn load(self, files: &mut Files<'_>) -> Result<BrokerConfig, Failure> {
        let config = files.config;
        let bad = |why: &str| Failure::content(config, why);
        let identity = match (&self.client_cert_file, &self.client_key_file) {
            (Some(certificate), Some(key)) => {
                Some(Identity { certificate: files.certificate(certificate)?, key: files.key(key)? })
            }
            (None, None) => None,
            _ => return Err(bad("broker.client_cert_file and broker.client_key_file belong together")),
        };
        let authority = self.ca_file.as_ref().map(|file| files.certificate(file)).transpose()?;
        let tls = match self.tls.unwrap_or(true) {
            true => Some(Tls { authority, identity }),
            false if authority.is_some() || identity.is_some() => {
                return Err(bad("broker: certificates are of no use where tls = false"));
            }
            false => None,
        };
        let login = match (self.user, self.password_file) {
            (Some(user), Some(file)) => Some(Login { user, password: files.password(&file)? }),
            (None, None) => None,
            _ => return Err(bad("broker.user and broker.password_file belong together")),
        };
        let client_id = self.client_id.unwrap_or_else(|| "pitchleak-gateway".to_owned());
        if client_id.is_empty() || self.host.is_empty() || self.in_flight == Some(0) {
            return Err(bad("broker: host and client_id must not be empty, nor in_flight 0"));
        }
        if tls.is_none() && login.is_some() {
            let open = "broker: the password goes over the network as it is: set tls = true";
            files.warnings.push(open.to_owned());
        }
        Ok(BrokerConfig {
            host: self.host,
            port: self.port.unwrap_or(if tls.is_some() { 8883 } else { 1883 }),
            client_id,
            tls,
            login,
            keep_alive_s: self.keep_alive_s.unwrap_or(30).max(1),
            in_flight: self.in_flight,
        })
    }
}

/// A path that begins so is in the folder that systemd gives a service its credentials in (`systemd.exec(5)`).
const CREDENTIALS: &str = "$CREDENTIALS_DIRECTORY/";

/// Who we are.
#[derive(Clone, PartialEq, Eq)]
pub struct Identity {
    /// PEM, with those between it and the authority.
    pub certificate: Vec<u8>,
    /// PEM.
    pub key: Vec<u8>,
}

#[derive(Clone, PartialEq, Eq)]
pub struct Login {
    pub user: String,
    pub password: String,
}

/// Reads the files that a configuration names.
struct Files<'a> {
    /// The configuration: paths are from its folder.
    config: &'a Path,
    /// What whoever set it up should know.
    warnings: Vec<String>,
}

impl Files<'_> {
    fn path(&self, file: &Path) -> Result<PathBuf, Failure> {
        let Some(name) = file.to_str().and_then(|path| path.strip_prefix(CREDENTIALS)) else {
            return Ok(self.config.parent().unwrap_or(Path::new("")).join(file));
        };
        let folder = std::env::var_os("CREDENTIALS_DIRECTORY");
        let none =
            || Failure::content(self.config, format!("{}: systemd gives no credentials", file.display()));
        folder.map(|folder| PathBuf::from(folder).join(name)).ok_or_else(none)
    }

    /// Certificates in PEM.
    fn certificate(&self, file: &Path) -> Result<Vec<u8>, Failure> {
        pem(&self.path(file)?, "CERTIFICATE-----")
    }

    /// A private key in PEM.
    fn key(&mut self, file: &Path) -> Result<Vec<u8>, Failure> {
        pem(&self.secret(file)?, "PRIVATE KEY-----")
    }

    /// Its one line.
    fn password(&mut self, file: &Path) -> Result<String, Failure> {
        let path = self.secret(file)?;
        let text = String::from_utf8(read(&path)?).map_err(|_| Failure::content(&path, "not UTF-8"))?;
        match text.lines().next() {
            Some(line) if !line.is_empty() => Ok(line.to_owned()),
            _ => Err(Failure::content(&path, "no password in its first line")),
        }
    }

    /// Where a secret lies, which is one's own: else that is said.
    fn secret(&mut self, file: &Path) -> Result<PathBuf, Failure> {
        let path = self.path(file)?;
        let mode = std::fs::metadata(&path).map_or(0, |about| about.permissions().mode());
        if mode & 0o077 != 0 {
            let (name, mode) = (path.display(), mode & 0o777);
            self.warnings.push(format!("{name}: others can read this secret (mode {mode:03o}): chmod 600"));
        }
        Ok(path)
    }
}

fn pem(path: &Path, what: &str) -> Result<Vec<u8>, Failure> {
    let bytes = read(path)?;
    if String::from_utf8_lossy(&bytes).contains(what) {
        return Ok(bytes);
    }
    let what = what.trim_end_matches('-').to_lowercase();
    Err(Failure::content(path, format!("no {what} in PEM")))
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    std::fs::read(path).map_err(|source| Failure::Read { path: path.to_owned(), source })
}
