//! Another configuration while the service runs: read whole and checked before anything of it counts.

use crate::broker::Broker;
use crate::config::Config;
use crate::log::Level;
use crate::service::Service;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The file, and what the service runs by.
pub struct Reloader {
    path: PathBuf,
    running: Config,
    every: Option<Duration>,
    looked: Instant,
    /// What was found at the last look and is not what the service runs by: whoever writes it may not have finished.
    found: Option<Config>,
}

impl Reloader {
    pub fn new(path: &Path, running: Config) -> Self {
        let (path, every) = (path.to_owned(), running.reload_every);
        Self { path, running, every, looked: Instant::now(), found: None }
    }

    /// Reads the file. One that cannot be used changes nothing.
    pub fn reload<B: Broker>(&mut self, service: &mut Service<B>) {
        match Config::load(&self.path) {
            Ok(config) => self.go_on_by(config, service),
            Err(failure) => {
                service.metrics.reload_failures.inc();
                let text = format!("{failure}: goes on as before");
                service.log.say(Level::Warning, "reload", &text);
            }
        }
    }

    /// Once in a while, where the configuration asks for it: goes on by what has changed and stays so.
    pub fn look<B: Broker>(&mut self, service: &mut Service<B>, now: Instant) {
        if self.every.is_none_or(|every| now.duration_since(self.looked) < every) {
            return;
        }
        self.looked = now;
        let found = Config::load(&self.path).ok().filter(|config| *config != self.running);
        match (found, self.found.take()) {
            (Some(config), Some(before)) if config == before => self.go_on_by(config, service),
            (found, _) => self.found = found,
        }
    }

    fn go_on_by<B: Broker>(&mut self, config: Config, service: &mut Service<B>) {
        let later = self.running.needs_a_start(&config);
        if !later.is_empty() {
            let text = format!("{}: as before until the next start", later.join(", "));
            service.log.say(Level::Warning, "reload_later", &text);
        }
        crate::run::warn(&service.log, &config.warnings);
        self.every = config.reload_every;
        self.running = config.clone();
        service.reload(Box::new(config));
    }
}
