//! Puts the service together, and ends it in order.

use crate::alarms::Alarms;
use crate::board::Board;
use crate::broker::{Inbound, Outbox};
use crate::config::{Config, Tls};
use crate::log::{Level, Log};
use crate::metrics::Metrics;
use crate::saver::{self, Disk, Pace, Saved, Summaries};
use crate::service::{Service, Waiting, status};
use crate::{Failure, http, mqtt};
use pitchleak::live::{Checkpoint, Watch};
use sd_notify::NotifyState;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Inputs that wait at most: with the largest payload, 64 MiB.
const INPUTS: usize = 64;
/// Between two looks at the clock.
const TICK: Duration = Duration::from_millis(100);
/// While more comes in, what goes out waits so long for company.
const TOGETHER: Duration = Duration::from_millis(2);
/// For the last messages, at the end.
const GOODBYE: Duration = Duration::from_secs(3);
/// For the last checkpoint.
const LAST_CHECKPOINT: Duration = Duration::from_secs(20);

/// What wakes the service.
pub enum Input {
    Broker(Inbound),
    Saved(Box<Saved>),
    /// A signal to end.
    Stop,
    /// A signal to read the configuration again.
    Reload,
}

/// Runs by the file at `path` until a signal asks it to end.
pub fn run(path: &Path, config: Config) -> Result<(), Failure> {
    let log = Arc::new(Log::default());
    warn(&log, &config.warnings);
    let checkpoint = Arc::new(Checkpoint::new(&config.state)?);
    let folder = config.state.join("summaries");
    let summaries =
        Summaries::new(folder.clone()).map_err(|source| Failure::Read { path: folder, source })?;
    let alarms_file = config.state.join("alarms.json");
    let alarms = known_alarms(&alarms_file, &log);

    let (inbox, inputs) = sync_channel(INPUTS);
    let metrics = Arc::new(Metrics::new(Arc::new(Board::new(config.silent_after))));
    if let Some(address) = config.listen {
        let bound = http::start(address, Arc::clone(&metrics), config.checkpoint)?;
        log.say(Level::Info, "http", &format!("page, metrics and health on http://{bound}"));
    }
    listen_for_signals(inbox.clone())?;
    let filters = config.samples.iter().map(|samples| samples.topic.clone()).collect();
    let outbox = Arc::new(Outbox::default());
    let gone = status(&config.base, "offline");
    let ended = mqtt::connect(&config.broker, filters, gone, Arc::clone(&outbox), inbox.clone())?;
    let disk = Disk { checkpoint: Arc::clone(&checkpoint), summaries, alarms: alarms_file };
    let (jobs, saver) = saver::start(disk, inbox)?;

    let pace = Pace::new(config.checkpoint, config.broker.in_flight, Instant::now());
    let watch = Watch::new(config.watch.clone(), None);
    let (samples, base) = (config.samples.clone(), config.base.clone());
    let waiting = Waiting::default();
    let mut service =
        Service { watch, outbox, jobs, checkpoint, alarms, samples, base, pace, metrics, log, waiting };
    service.begin()?;
    let mut reloader = Reloader::new(path, config);
    say(&[NotifyState::Ready]);
    while serve(&mut service, &inputs, &mut reloader) {
        let now = NotifyState::monotonic_usec_now().ok();
        say(&[NotifyState::Reloading].into_iter().chain(now).collect::<Vec<_>>());
        reloader.reload(&mut service);
        say(&[NotifyState::Ready]);
    }
    say(&[NotifyState::Stopping]);
    end(service, inputs, &ended);
    let _ = saver.join();
    Ok(())
}

/// Where nobody asks, nobody is told.
fn say(state: &[NotifyState<'_>]) {
    let _ = sd_notify::notify(state);
}

fn warn(log: &Log, warnings: &[String]) {
    // Each is a kind of its own: they are few.
    warnings.iter().for_each(|warning| log.say(Level::Warning, &format!("config {warning}"), warning));
}

fn listen_for_signals(inbox: SyncSender<Input>) -> Result<(), Failure> {
    let mut signals = Signals::new([SIGHUP, SIGINT, SIGTERM]).map_err(Failure::Signals)?;
    let run = move || {
        for signal in signals.forever() {
            let input = if signal == SIGHUP { Input::Reload } else { Input::Stop };
            if inbox.send(input).is_err() {
                return;
            }
        }
    };
    thread("signals", run).map(drop)
}

/// Starts a thread of this name.
pub fn thread(
    name: &'static str,
    run: impl FnOnce() + Send + 'static,
) -> Result<std::thread::JoinHandle<()>, Failure> {
    let spawned = std::thread::Builder::new().name(name.to_owned()).spawn(run);
    spawned.map_err(|source| Failure::Thread { name, source })
}

/// Runs a task, and those that it starts, in a thread of this name that waits for the network alone.
pub fn network_thread<T: Future<Output = ()>>(
    name: &'static str,
    task: impl FnOnce() -> T + Send + 'static,
) -> Result<(), Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|source| Failure::Thread { name, source })?;
    thread(name, move || runtime.block_on(task())).map(drop)
}

/// Those of a run before; one that is damaged is put aside.
fn known_alarms(file: &Path, log: &Log) -> Alarms {
    let Ok(text) = std::fs::read_to_string(file) else { return Alarms::default() };
    Alarms::parse(&text).unwrap_or_else(|error| {
        let _ = std::fs::rename(file, file.with_extension("json.aside"));
        let text = format!(
            "{}: {error}: alarms that were on their way may be missing or come twice",
            file.display()
        );
        log.say(Level::Warning, "alarms", &text);
        Alarms::default()
    })
}

/// Until the service is to end, or, which it says, to be reloaded.
fn serve(service: &mut Service, inputs: &Receiver<Input>, reloader: &mut Reloader) -> bool {
    let watchdog = sd_notify::watchdog_enabled().map(|period| period / 2);
    let (mut ticked, mut sent, mut told) = (Instant::now(), Instant::now(), Instant::now());
    loop {
        let input = inputs.try_recv().or_else(|_| {
            service.outbox.send();
            inputs.recv_timeout(TICK)
        });
        match input {
            Ok(Input::Reload) => return true,
            Ok(input) => {
                if !service.take(input) {
                    return false;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return false,
        }
        let now = Instant::now();
        if now.duration_since(sent) >= TOGETHER {
            sent = now;
            service.outbox.send();
        }
        // A flood leaves no pause.
        if now.duration_since(ticked) >= TICK / 10 {
            ticked = now;
            service.tick(now);
            reloader.look(service, now);
        }
        if watchdog.is_some_and(|period| now.duration_since(told) >= period) {
            told = now;
            say(&[NotifyState::Watchdog]);
        }
    }
}

/// The last checkpoint, then what the broker should have.
fn end(mut service: Service, inputs: Receiver<Input>, ended: &Receiver<()>) {
    let until = Instant::now() + LAST_CHECKPOINT;
    while Instant::now() < until && (service.waiting.saving || service.waiting.changed) {
        if !service.waiting.saving {
            service.save();
        }
        // What else comes stays with the broker.
        if let Ok(Input::Saved(saved)) = inputs.recv_timeout(TICK) {
            service.take(Input::Saved(saved));
        }
    }
    let connected = service.metrics.connected.get() != 0;
    let Service { outbox, base, jobs, .. } = service;
    // The network thread and the saver no longer wait for us.
    drop((jobs, inputs));
    outbox.put(status(&base, "offline"));
    outbox.close();
    let _ = ended.recv_timeout(if connected { GOODBYE } else { Duration::ZERO });
}

/// What a configuration asks for.
pub fn in_words(config: &Config) -> String {
    let broker = &config.broker;
    let tls = match &broker.tls {
        None => "without TLS: whoever listens reads along",
        Some(Tls { authority: Some(_), .. }) => "TLS by the given authority",
        Some(Tls { authority: None, .. }) => "TLS by the system's authorities",
    };
    let identity = broker.tls.as_ref().is_some_and(|tls| tls.identity.is_some());
    let certificate = if identity { ", with a certificate" } else { "" };
    let login = broker.login.as_ref().map_or("nobody".to_owned(), |login| login.user.clone());
    let listen = config.listen.map_or("nowhere".to_owned(), |address| format!("on {address}"));
    let topics: Vec<_> = config.samples.iter().map(|samples| samples.topic.as_str()).collect();
    let others = if config.watch.rig.is_some() { "and any other cylinder" } else { "no other cylinder" };
    format!(
        "broker {}:{}, {tls}, as {login}{certificate}, session `{}`\nsamples from {}\n{} cylinders by name, {others}\nestimates and alarms to \
         {}/…\nstate in {}, a checkpoint every {} s\npage, metrics and health {listen}",
        broker.host,
        broker.port,
        broker.client_id,
        topics.join(", "),
        config.watch.cylinders.len(),
        config.base,
        config.state.display(),
        config.checkpoint.as_secs_f64(),
    )
}

/// Another configuration while the service runs, read whole and checked before anything of it counts: the file, and what the
/// service runs by.
struct Reloader {
    path: PathBuf,
    running: Config,
    looked: Instant,
    /// What was found at the last look and is not what the service runs by: whoever writes it may not have finished.
    found: Option<Config>,
}

impl Reloader {
    fn new(path: &Path, running: Config) -> Self {
        Self { path: path.to_owned(), running, looked: Instant::now(), found: None }
    }

    /// Reads the file. One that cannot be used changes nothing.
    fn reload(&mut self, service: &mut Service) {
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
    fn look(&mut self, service: &mut Service, now: Instant) {
        if self.running.reload_every.is_none_or(|every| now.duration_since(self.looked) < every) {
            return;
        }
        self.looked = now;
        let found = Config::load(&self.path).ok().filter(|config| *config != self.running);
        match (found, self.found.take()) {
            (Some(config), Some(before)) if config == before => self.go_on_by(config, service),
            (found, _) => self.found = found,
        }
    }

    fn go_on_by(&mut self, config: Config, service: &mut Service) {
        let later = self.running.needs_a_start(&config);
        if !later.is_empty() {
            let text = format!("{}: as before until the next start", later.join(", "));
            service.log.say(Level::Warning, "reload_later", &text);
        }
        warn(&service.log, &config.warnings);
        self.running = config.clone();
        service.reload(Box::new(config));
    }
}
