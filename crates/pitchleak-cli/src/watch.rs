use crate::Outcome;
use crate::input::one_of;
use crate::output::{self, Failure, at_the_end};
use clap::Args;
use pitchleak::Rig;
use pitchleak::live::{Checkpoint, Event, LineFormat, LiveConfig, OutputFormat, Snapshot, Watch};
use std::io::{self, BufRead};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Watch cylinders live: samples in on standard input, estimates and alarms out on standard output
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// Rig file of all cylinders [default: the built-in rig wu2011]
    #[arg(long, value_name = "FILE", conflicts_with = "config")]
    rig: Option<PathBuf>,

    /// Which cylinders there are, and their rigs (TOML)
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,

    /// Format of the lines: ndjson, csv or influx [default: told by the first line]
    #[arg(long, value_name = "FORMAT", value_parser = one_of(format, "ndjson, csv, influx"))]
    format: Option<LineFormat>,

    /// Print influx line protocol instead of JSON
    #[arg(long)]
    influx_out: bool,

    /// Keep the estimators' state in this folder, and go on from it
    #[arg(long, value_name = "DIR")]
    state: Option<PathBuf>,
}

const EXAMPLES: &str = r#"Examples:
  pitchleak watch --rig turbine7.toml --state /var/lib/pitchleak < fieldbus.ndjson
  {"cylinder": "T7/B2", "t_s": 12.34, "x_mm": 40.6, "pa_bar": 51.3, "pb_bar": 40.8, "qa_lpm": 2.01, "qb_lpm": -1.27}
A cell is named as in a trace's header; `timestamp` (ISO 8601) may stand for `t_s`."#;

/// Time between two checkpoints.
const CHECKPOINT: Duration = Duration::from_secs(10);
/// A longer line is no sample.
const LONGEST_LINE: usize = 64 * 1024;
/// Blocks of input that wait for the estimators at most.
const WAITING: usize = 8;

fn format(name: &str) -> Option<LineFormat> {
    LineFormat::NAMES.into_iter().find_map(|(known, format)| (known == name).then_some(format))
}

/// What wakes the watch.
enum Input {
    /// Whole lines, as they came together.
    Lines(Vec<Vec<u8>>),
    /// A line that does not end.
    TooLong,
    /// The end, or a signal to end.
    End,
    Failed(io::Error),
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let config = match (&arguments.config, &arguments.rig) {
        (Some(path), _) => LiveConfig::load(path)?,
        (None, Some(path)) => LiveConfig::of(Rig::load(path)?),
        (None, None) => LiveConfig::of(Rig::paper()),
    };
    let mut watch = Watch::new(config, arguments.format);
    let checkpoint = arguments.state.as_deref().map(Checkpoint::new).transpose()?;
    let format = if arguments.influx_out { OutputFormat::Influx } else { OutputFormat::Ndjson };
    let restored = checkpoint.as_ref().map(|checkpoint| checkpoint.restore(&mut watch)).transpose()?;
    let notices = restored.unwrap_or_default();
    notices.iter().for_each(|notice| output::complain("warning", &notice.text));
    print(&notices.into_iter().map(Event::Notice).collect::<Vec<_>>(), format)?;
    let outcome = serve(&mut watch, &inputs()?, checkpoint.as_ref(), format);
    if let Some(checkpoint) = &checkpoint {
        checkpoint.save(&Snapshot::of(&mut watch))?;
    }
    outcome?;
    let left_out: u64 = watch.left_out().values().sum();
    if watch.cylinders() == 0 && left_out > 0 { Err(Failure::NoSample(left_out)) } else { Ok(Outcome::Done) }
}

fn serve(
    watch: &mut Watch,
    inputs: &Receiver<Input>,
    checkpoint: Option<&Checkpoint>,
    format: OutputFormat,
) -> Result<(), Failure> {
    let mut events = Vec::new();
    let (mut saved, mut changed) = (Instant::now(), false);
    loop {
        let is_unsaved = changed && checkpoint.is_some();
        let wait = if is_unsaved { CHECKPOINT.saturating_sub(saved.elapsed()) } else { Duration::MAX };
        match next(inputs, wait) {
            Some(Input::Lines(lines)) => lines.iter().for_each(|line| watch.take(line, &mut events)),
            Some(Input::TooLong) => {
                watch.notice("too_long", format!("longer than {LONGEST_LINE} bytes"), &mut events);
            }
            Some(Input::Failed(error)) => return Err(Failure::Input(error)),
            Some(Input::End) => {
                watch.finish(&mut events);
                return print(&events, format);
            }
            None => {}
        }
        changed = true;
        print(&events, format)?;
        events.clear();
        if let Some(checkpoint) = checkpoint.filter(|_| saved.elapsed() >= CHECKPOINT) {
            // A disk that is full now may have room later: the samples go on.
            let snapshot = Snapshot::of(watch);
            let written = checkpoint.save(&snapshot);
            (saved, changed) = (Instant::now(), written.is_err());
            if let Err(error) = written {
                output::complain("warning", &error);
                snapshot.give_back(watch);
            }
        }
    }
}

/// What wakes the watch next; none where nothing does within `wait`.
fn next(inputs: &Receiver<Input>, wait: Duration) -> Option<Input> {
    match inputs.recv_timeout(wait) {
        Err(RecvTimeoutError::Timeout) => None,
        input => Some(input.unwrap_or(Input::End)),
    }
}

/// All at once, so that what belongs together is seen together.
fn print(events: &[Event], format: OutputFormat) -> Result<(), Failure> {
    if events.is_empty() {
        return Ok(());
    }
    let mut text = String::new();
    for event in events {
        text += &(event.line(format)? + "\n");
    }
    output::print(&text)
}

/// Standard input in a thread of its own, and signals, so that either wakes the watch.
fn inputs() -> Result<Receiver<Input>, Failure> {
    let (sender, receiver) = sync_channel(WAITING);
    let at_signal = sender.clone();
    // Whatever waits is taken in first.
    at_the_end(move |_| drop(at_signal.send(Input::End)))?;
    std::thread::spawn(move || read(&mut io::stdin().lock(), &sender));
    Ok(receiver)
}

/// Lines as they come, until nobody listens.
fn read(source: &mut impl BufRead, sender: &SyncSender<Input>) {
    let mut rest = Vec::new();
    let mut skipping = false;
    loop {
        let bytes = match source.fill_buf() {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => {
                let _ = sender.send(Input::Failed(error));
                return;
            }
        };
        let length = bytes.len();
        let mut lines = Vec::new();
        for part in bytes.split_inclusive(|byte| *byte == b'\n') {
            let ends = part.ends_with(b"\n");
            if !skipping {
                rest.extend_from_slice(part);
            }
            if ends && !std::mem::take(&mut skipping) {
                lines.push(std::mem::take(&mut rest));
            }
        }
        source.consume(length);
        if length == 0 && !rest.is_empty() {
            lines.push(std::mem::take(&mut rest));
        }
        let mut gone = !lines.is_empty() && sender.send(Input::Lines(lines)).is_err();
        if rest.len() > LONGEST_LINE {
            (rest, skipping) = (Vec::new(), true);
            gone |= sender.send(Input::TooLong).is_err();
        }
        if length == 0 || gone {
            let _ = sender.send(Input::End);
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufReader, Cursor};

    #[test]
    fn a_line_without_end_is_told_and_the_next_one_is_read() {
        let text = [b"a\n".as_slice(), &[b'x'; 3 * LONGEST_LINE], b"\nb\nc"].concat();
        let (sender, receiver) = sync_channel(1000);
        read(&mut BufReader::with_capacity(1000, Cursor::new(text)), &sender);
        let mut lines = Vec::new();
        let mut too_long = 0;
        for input in receiver.try_iter() {
            match input {
                Input::Lines(more) => lines.extend(more),
                Input::TooLong => too_long += 1,
                Input::End | Input::Failed(_) => {}
            }
        }
        let lines: Vec<_> = lines.iter().map(|line| line.trim_ascii()).collect();
        assert_eq!((lines, too_long), (vec![b"a".as_slice(), b"b", b"c"], 1));
    }
}
