//! Any lines of a feed, in any format, to a watch that knows a cylinder or none: events with numbers, of bounded count.

use super::{assert_told, trace_text};
use pitchleak::Rig;
use pitchleak::live::{LineFormat, LiveConfig, OutputFormat, Watch};
use std::sync::LazyLock;

/// A feed that goes well, in each format.
static USUAL: LazyLock<[Vec<String>; 3]> = LazyLock::new(|| [ndjson(300), csv(300), influx(300)]);

pub fn enter(bytes: &[u8]) {
    let Some((choice, lines)) = bytes.split_first() else { return };
    let [(_, ndjson), (_, csv), (_, influx)] = LineFormat::NAMES;
    let format = [None, Some(ndjson), Some(csv), Some(influx)][usize::from(choice % 4)];
    let config = LiveConfig { most_cylinders: 3, ..LiveConfig::of(Rig::paper()) };
    let (mut watch, mut events) = (Watch::new(config, format), Vec::new());
    if let (Some(usual), true) = (USUAL.get(usize::from(choice % 4).wrapping_sub(1)), choice & 4 != 0) {
        usual.iter().for_each(|line| watch.take(line.as_bytes(), &mut events));
    }
    for line in lines.split(|byte| *byte == b'\n') {
        watch.take(line, &mut events);
    }
    watch.tell_counted(&mut events);
    watch.finish(&mut events);
    assert_told(&events);
    assert!(watch.cylinders() <= 3);
    let again: Vec<String> =
        events.iter().map(|event| event.line(OutputFormat::Ndjson).expect("a line")).collect();
    for line in again {
        serde_json::from_str::<serde_json::Value>(&line).expect("JSON");
    }
}

/// Names and cells of the rows of a trace.
fn rows(count: usize) -> Vec<Vec<(String, String)>> {
    let text = trace_text(0, count);
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let names = lines.next().unwrap_or_default();
    lines.map(|cells| names.iter().cloned().zip(cells).collect()).collect()
}

fn ndjson(count: usize) -> Vec<String> {
    let member = |(name, cell): (String, String)| format!("\"{name}\":{cell}");
    let line = |row: Vec<_>| row.into_iter().map(member).collect::<Vec<_>>().join(",");
    rows(count).into_iter().map(|row| format!("{{\"cylinder\":\"T7/B2\",{}}}", line(row))).collect()
}

fn csv(count: usize) -> Vec<String> {
    trace_text(0, count).lines().map(str::to_owned).collect()
}

fn influx(count: usize) -> Vec<String> {
    let field = |(name, cell): (String, String)| format!("{name}={cell}");
    let line = |row: Vec<_>| row.into_iter().map(field).collect::<Vec<_>>().join(",");
    rows(count).into_iter().map(|row| format!("pitch,cylinder=T7/B2 {}", line(row))).collect()
}
