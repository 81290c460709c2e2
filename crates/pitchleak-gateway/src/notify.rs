//! What systemd is told (`sd_notify(3)`): nothing where nobody asks.

use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};

pub struct Notify {
    socket: Option<(UnixDatagram, SocketAddr)>,
    /// Twice as often as the watchdog wants it.
    every: Option<Duration>,
    told: Instant,
}

impl Notify {
    /// As the environment says.
    pub fn from_env() -> Self {
        let address = std::env::var("NOTIFY_SOCKET").ok().and_then(|path| match path.strip_prefix('@') {
            Some(name) => SocketAddr::from_abstract_name(name).ok(),
            None => SocketAddr::from_pathname(path).ok(),
        });
        let socket = address.and_then(|address| Some((UnixDatagram::unbound().ok()?, address)));
        let microseconds = std::env::var("WATCHDOG_USEC").ok().and_then(|text| text.parse().ok());
        Self {
            socket,
            every: microseconds.map(|us: u64| Duration::from_micros(us / 2)),
            told: Instant::now(),
        }
    }

    pub fn tell(&self, state: &str) {
        if let Some((socket, address)) = &self.socket {
            let _ = socket.send_to_addr(state.as_bytes(), address);
        }
    }

    /// That the service is alive, as often as it is asked for.
    pub fn alive(&mut self) {
        if self.every.is_some_and(|every| self.told.elapsed() >= every) {
            self.told = Instant::now();
            self.tell("WATCHDOG=1");
        }
    }
}
