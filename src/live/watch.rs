use super::config::LiveConfig;
use super::cylinder::Cylinder;
use super::event::Event;
use super::format::{Fields, LineFormat, Parser};
use super::notices::Notices;
use crate::trace::LineLayout;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Cylinders beyond these are left out: a feed that invents names must not eat the memory.
const MOST_CYLINDERS: usize = 10_000;
/// A longer name is none.
const LONGEST_NAME: usize = 200;
/// Sets of names that are remembered with what they mean.
const LAYOUTS: usize = 16;

/// Watches many cylinders, line by line.
pub struct Watch {
    config: LiveConfig,
    parser: Option<Parser>,
    layouts: Layouts,
    pub(super) cylinders: BTreeMap<String, Cylinder>,
    /// Of lines that belong to no cylinder.
    notices: Notices,
    lines: u64,
}

impl Watch {
    /// Watches what `config` says; the first line tells the format where it is not given.
    pub fn new(config: LiveConfig, format: Option<LineFormat>) -> Self {
        Self {
            config,
            parser: format.map(Parser::new),
            layouts: Layouts::default(),
            cylinders: BTreeMap::new(),
            notices: Notices::default(),
            lines: 0,
        }
    }

    /// What is watched.
    pub fn config(&self) -> &LiveConfig {
        &self.config
    }

    /// Takes in a line, without its end; what there is to say goes to `events`. No line is an error: one that is of no
    /// use is counted.
    pub fn take(&mut self, line: &[u8], events: &mut Vec<Event>) {
        self.lines += 1;
        let line = line.trim_ascii_end();
        if line.is_empty() {
            return;
        }
        if let Err((kind, text)) = self.take_sample(line, events) {
            self.notice(kind, text, events);
        }
    }

    /// Counts input that was not even a line.
    pub fn notice(&mut self, kind: &str, text: String, events: &mut Vec<Event>) {
        let text = format!("line {}: {text}", self.lines);
        events.extend(self.notices.add("", None, kind, text).map(Event::Notice));
    }

    /// At the end of the input: the last estimates, and what was counted and not said.
    pub fn finish(&mut self, events: &mut Vec<Event>) {
        for (name, cylinder) in &mut self.cylinders {
            cylinder.finish(name, events);
        }
        events.extend(self.notices.rest("", None).into_iter().map(Event::Notice));
    }

    fn take_sample(&mut self, line: &[u8], events: &mut Vec<Event>) -> Result<(), (&'static str, String)> {
        let line = std::str::from_utf8(line).map_err(|_| ("unreadable", "not UTF-8".to_owned()))?;
        let parser = self.parser.get_or_insert_with(|| Parser::new(LineFormat::of(line)));
        let parsed = parser.parse(line).map_err(|why| ("unreadable", why))?;
        let Some(Fields { cylinder: name, names, cells }) = parsed else { return Ok(()) };
        if !self.cylinders.contains_key(name.as_ref()) {
            let cylinder = begin(&self.config, &name, self.cylinders.len())?;
            self.cylinders.insert(name.clone().into_owned(), cylinder);
        }
        let Some(cylinder) = self.cylinders.get_mut(name.as_ref()) else { return Ok(()) };
        let layout = match self.layouts.find(&names, cylinder) {
            Ok(layout) => layout,
            Err(why) => {
                cylinder.notice(&name, "columns", format!("line {}: {why}", self.lines), events);
                return Ok(());
            }
        };
        let cells: Vec<&[u8]> = cells.iter().map(|cell| cell.as_bytes()).collect();
        let interval_s = self.config.interval_s;
        cylinder
            .take(&name, interval_s, layout, self.lines, &cells, events)
            .map_err(|fault| ("unreadable", fault.to_string()))
    }
}

fn begin(config: &LiveConfig, name: &str, there_are: usize) -> Result<Cylinder, (&'static str, String)> {
    let shown = || name.chars().take(40).collect::<String>();
    if there_are >= MOST_CYLINDERS || name.len() > LONGEST_NAME || name.contains(char::is_control) {
        return Err(("too_many_cylinders", format!("`{}` is left out", shown())));
    }
    let rig = config.rig_of(name).ok_or_else(|| ("unknown_cylinder", format!("`{}` has no rig", shown())))?;
    Cylinder::new(rig).map_err(|error| ("unknown_cylinder", error.to_string()))
}

/// What sets of names mean, the last used first.
#[derive(Default)]
struct Layouts(Vec<(String, Vec<String>, LineLayout)>);

impl Layouts {
    fn find(&mut self, names: &[Cow<'_, str>], cylinder: &Cylinder) -> Result<&LineLayout, String> {
        let rig = cylinder.rig();
        let known = self.0.iter().position(|(rig_name, known, _)| *rig_name == rig.name && known == names);
        match known {
            Some(0) => {}
            Some(at) => self.0.swap(0, at),
            None => {
                let names: Vec<String> = names.iter().map(|name| name.clone().into_owned()).collect();
                let layout = LineLayout::new(&names, rig).map_err(|fault| fault.to_string())?;
                self.0.insert(0, (rig.name.clone(), names, layout));
                self.0.truncate(LAYOUTS);
            }
        }
        self.0.first().map(|(_, _, layout)| layout).ok_or_else(String::new)
    }
}
