//! Puts the service together, and ends it in order.

use crate::broker::Broker;
use crate::config::{Config, Tls};
use crate::failure::Failure;
use crate::input::Input;
use crate::log::{Level, Log};
use crate::metrics::Metrics;
use crate::mqtt::Mqtt;
use crate::notify::Notify;
use crate::pace::Pace;
use crate::service::{Service, Waiting, status};
use crate::summaries::Summaries;
use crate::{http, saver};
use pitchleak::live::{Checkpoint, Watch};
use std::fs::{File, TryLockError};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
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

/// Runs until a signal asks it to end.
pub fn run(config: Config) -> Result<(), Failure> {
    let mut notify = Notify::from_env();
    let log = Arc::new(Log::default());
    let checkpoint = Checkpoint::new(&config.state)?;
    let _lock = lock(&config.state.join("lock"))?;
    let mut watch = Watch::new(config.watch, None);
    let restored = checkpoint.restore(&mut watch)?;
    if let Some(notice) = &restored.notice {
        log.say(Level::Warning, "checkpoint", &notice.text);
    }
    let folder = config.state.join("summaries");
    let summaries =
        Summaries::new(folder.clone()).map_err(|source| Failure::Read { path: folder, source })?;

    let (inbox, inputs) = sync_channel(INPUTS);
    let metrics = Arc::new(Metrics::new());
    if let Some(address) = config.listen {
        let bound = http::start(address, Arc::clone(&metrics), config.checkpoint)?;
        log.say(Level::Info, "http", &format!("metrics and health on http://{bound}"));
    }
    let at_signal = inbox.clone();
    ctrlc::set_handler(move || drop(at_signal.send(Input::Stop))).map_err(|error| Failure::System {
        what: "wait for signals",
        source: std::io::Error::other(error),
    })?;
    let filters = config.samples.iter().map(|samples| samples.topic.clone()).collect();
    let broker = Mqtt::connect(&config.broker, filters, status(&config.base, "offline"), inbox.clone())?;
    let (jobs, saver) = saver::start(checkpoint, summaries, inbox)?;

    let pace = Pace::new(config.checkpoint, config.broker.in_flight, Instant::now());
    let waiting = Waiting::default();
    let (samples, base) = (config.samples, config.base);
    let mut service = Service { watch, broker, jobs, samples, base, pace, metrics, log, waiting };
    service.resend(restored.unsent);
    notify.tell("READY=1");
    serve(&mut service, &inputs, &mut notify);
    notify.tell("STOPPING=1");
    end(service, inputs);
    let _ = saver.join();
    Ok(())
}

fn serve<B: Broker>(service: &mut Service<B>, inputs: &Receiver<Input>, notify: &mut Notify) {
    let mut ticked = Instant::now();
    let mut sent = ticked;
    loop {
        let input = inputs.try_recv().or_else(|_| {
            service.broker.send();
            inputs.recv_timeout(TICK)
        });
        match input {
            Ok(input) => {
                if !service.take(input) {
                    return;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        let now = Instant::now();
        if now.duration_since(sent) >= TOGETHER {
            sent = now;
            service.broker.send();
        }
        // A flood leaves no pause.
        if now.duration_since(ticked) >= TICK / 10 {
            ticked = now;
            service.tick(now);
            notify.alive();
        }
    }
}

/// The last checkpoint, then what the broker should have.
fn end<B: Broker>(mut service: Service<B>, inputs: Receiver<Input>) {
    let until = Instant::now() + LAST_CHECKPOINT;
    while Instant::now() < until && (service.is_saving() || service.has_changed()) {
        if !service.is_saving() {
            service.save();
        }
        // What else comes stays with the broker.
        if let Ok(Input::Saved(saved)) = inputs.recv_timeout(TICK) {
            service.take(Input::Saved(saved));
        }
    }
    let connected = service.metrics.connected.load(Relaxed);
    let Service { broker, base, jobs, .. } = service;
    // The network thread and the saver no longer wait for us.
    drop((jobs, inputs));
    broker.publish(status(&base, "offline"));
    broker.close(if connected { GOODBYE } else { Duration::ZERO });
}

/// Two services with one state would spoil it.
fn lock(path: &Path) -> Result<File, Failure> {
    let failed = |source| Failure::Read { path: path.to_owned(), source };
    let file = File::options().create(true).truncate(false).write(true).open(path).map_err(failed)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Failure::Taken { path: path.to_owned() }),
        Err(TryLockError::Error(source)) => Err(failed(source)),
    }
}

/// What a configuration asks for.
pub fn in_words(config: &Config) -> String {
    let broker = &config.broker;
    let tls = match &broker.tls {
        None => "without TLS: whoever listens reads along",
        Some(Tls::Authority(_)) => "TLS by the given authority",
        Some(Tls::System) => "TLS by the system's authorities",
    };
    let login = broker.login.as_ref().map_or("nobody".to_owned(), |login| login.user.clone());
    let listen = config.listen.map_or("nowhere".to_owned(), |address| format!("on {address}"));
    let topics: Vec<_> = config.samples.iter().map(|samples| samples.topic.as_str()).collect();
    let others = if config.watch.rig.is_some() { "and any other cylinder" } else { "no other cylinder" };
    format!(
        "broker {}:{}, {tls}, as {login}, session `{}`\nsamples from {}\n{} cylinders by name, {others}\nestimates and alarms to \
         {}/…\nstate in {}, a checkpoint every {} s\nmetrics {listen}",
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
