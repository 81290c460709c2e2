//! Any messages of a broker, in each format of the gateway, on any topic: events with numbers, on topics that MQTT allows.

use super::{assert_told, checkpoint, trace_text};
use pitchleak::Rig;
use pitchleak::live::{Batch, BatchFormat, Event, LiveConfig, Watch};

#[allow(dead_code)]
#[path = "../../crates/pitchleak-gateway/src/topics.rs"]
mod topics;

/// Between the parts: topic, payload, topic, payload …
const BETWEEN: u8 = 0x1e;

pub fn enter(bytes: &[u8]) {
    let Some((choice, rest)) = bytes.split_first() else { return };
    let config = LiveConfig { most_cylinders: 3, ..LiveConfig::of(Rig::paper()) };
    let (mut watch, mut events) = (Watch::new(config, None), Vec::new());
    if choice & 8 != 0 {
        let payload = trace_text(0, 300);
        let batch =
            Batch { cylinder: "T7/B2", format: BatchFormat::Csv, payload: payload.as_bytes(), resent: false };
        watch.take_batch(&batch, &mut events);
    }
    let format = [BatchFormat::Json, BatchFormat::Csv, BatchFormat::Neuron][usize::from(choice % 3)];
    let mut parts = rest.split(|byte| *byte == BETWEEN);
    while let (Some(topic), Some(payload)) = (parts.next(), parts.next()) {
        let topic = String::from_utf8_lossy(topic);
        let Some(cylinder) = topics::cylinder_of("pitch/+/+", &topic) else { continue };
        let batch = Batch { cylinder: &cylinder, format, payload, resent: choice & 16 != 0 };
        watch.take_batch(&batch, &mut events);
    }
    checkpoint::assert_restores(&mut watch);
    watch.tell_counted(&mut events);
    watch.finish(&mut events);
    assert_told(&events);
    assert!(watch.cylinders() <= 3);
    for event in &events {
        let topic = topics::of_cylinder("pitchleak", cylinder_of(event), "estimate");
        let allowed = topics::is_filter(&topic) && !topic.contains(['+', '#']);
        assert!(allowed, "{topic:?}");
    }
}

fn cylinder_of(event: &Event) -> &str {
    match event {
        Event::Estimate(event) => &event.cylinder,
        Event::Alarm(event) => &event.cylinder,
        Event::Notice(event) => &event.cylinder,
        Event::Summary(event) => &event.cylinder,
        Event::Hold(event) => &event.cylinder,
    }
}
