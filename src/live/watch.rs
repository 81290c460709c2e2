use super::batch::{self, Batch};
use super::config::LiveConfig;
use super::cylinder::{Cylinder, Line};
use super::event::Event;
use super::format::{Fields, LineFormat, Parser};
use super::layouts::Layouts;
use super::notices::Notices;
use crate::Rig;
use crate::header::shorten;
use std::collections::BTreeMap;

/// A longer name is none.
const LONGEST_NAME: usize = 200;

/// Watches many cylinders, line by line or message by message.
pub struct Watch {
    config: LiveConfig,
    parser: Option<Parser>,
    layouts: Layouts,
    pub(super) cylinders: BTreeMap<String, Cylinder>,
    /// Of lines that belong to no cylinder.
    notices: Notices,
    lines: u64,
}

/// Why a line belongs to no cylinder: the kind of the notice, and its words.
type Refusal = (&'static str, String);

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

    /// Cylinders of which samples came.
    pub fn cylinders(&self) -> usize {
        self.cylinders.len()
    }

    /// Takes in a line, without its end; what there is to say goes to `events`. No line is an error: one that is of no
    /// use is counted.
    pub fn take(&mut self, line: &[u8], events: &mut Vec<Event>) {
        self.lines += 1;
        let line = line.trim_ascii_end();
        if line.is_empty() {
            return;
        }
        if let Err((kind, text)) = self.take_line(line, events) {
            self.notice(kind, text, events);
        }
    }

    /// Takes in a message, its samples in the order of their times and each once; what there is to say goes to `events`. No
    /// message is an error: what is of no use is counted.
    pub fn take_batch(&mut self, batch: &Batch<'_>, events: &mut Vec<Event>) {
        let samples = batch::parse(batch).unwrap_or_else(|why| vec![Err(why)]);
        let mut refusals: Vec<Refusal> = Vec::new();
        let mut in_turn = Vec::with_capacity(samples.len());
        for sample in samples {
            match sample {
                Ok(fields) => {
                    let t_s = self.time_s(&fields, fields.cylinder_or(batch.cylinder));
                    in_turn.push((t_s.unwrap_or(f64::INFINITY), fields));
                }
                Err(why) => refusals.push(("unreadable", why)),
            }
        }
        in_turn.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        for (_, fields) in &in_turn {
            self.lines += 1;
            let name = fields.cylinder_or(batch.cylinder);
            refusals.extend(self.take_fields(fields, name, events, |cylinder, config, line, events| {
                cylinder.take_in_turn(config, batch.resent, line, events);
            }));
        }
        for (kind, text) in refusals {
            self.notice(kind, text, events);
        }
    }

    /// Counts input that was not even a line.
    pub fn notice(&mut self, kind: &str, text: String, events: &mut Vec<Event>) {
        let text = format!("line {}: {text}", self.lines);
        events.extend(self.notices.add("", [None; 2], kind, text).map(Event::Notice));
    }

    /// At the end of the input: the last estimates, and what was counted and not said.
    pub fn finish(&mut self, events: &mut Vec<Event>) {
        for (name, cylinder) in &mut self.cylinders {
            cylinder.finish(name, events);
        }
        self.tell_counted(events);
    }

    /// Says what was counted and not said of lines that belong to no cylinder: they have no time, by which the next notice
    /// could be due.
    pub fn tell_counted(&mut self, events: &mut Vec<Event>) {
        events.extend(self.notices.rest("", [None; 2]).into_iter().map(Event::Notice));
    }

    fn take_line(&mut self, line: &[u8], events: &mut Vec<Event>) -> Result<(), Refusal> {
        let line = std::str::from_utf8(line).map_err(|_| ("unreadable", "not UTF-8".to_owned()))?;
        let mut parser = self.parser.take().unwrap_or_else(|| Parser::new(LineFormat::of(line)));
        let taken = match parser.parse(line) {
            Err(why) => Err(("unreadable", why)),
            Ok(None) => Ok(()),
            Ok(Some(fields)) => {
                let refused = self.take_fields(&fields, &fields.cylinder, events, Cylinder::take);
                refused.map_or(Ok(()), Err)
            }
        };
        self.parser = Some(parser);
        taken
    }

    /// Gives a sample to the cylinder of this name; says why, where there is none for it.
    fn take_fields(
        &mut self,
        fields: &Fields<'_>,
        name: &str,
        events: &mut Vec<Event>,
        take: impl FnOnce(&mut Cylinder, &LiveConfig, &Line<'_>, &mut Vec<Event>),
    ) -> Option<Refusal> {
        if let Some(cylinder) = self.cylinders.get_mut(name) {
            match self.layouts.find(&fields.names, cylinder.rig()) {
                Ok(layout) => {
                    let line = Line { name, layout, number: self.lines, cells: &cells(fields) };
                    take(cylinder, &self.config, &line, events);
                }
                Err(why) => cylinder.notice(name, "columns", format!("line {}: {why}", self.lines), events),
            }
            return None;
        }
        let begun = self.begin(fields, name);
        begun.map_or_else(Some, |()| self.take_fields(fields, name, events, take))
    }

    /// A cylinder of which nothing came yet.
    #[cold]
    fn begin(&mut self, fields: &Fields<'_>, name: &str) -> Result<(), Refusal> {
        let rig = rig_of(&self.config, &self.cylinders, name)?;
        self.layouts.find(&fields.names, rig).map_err(|why| ("columns", why))?;
        let cylinder = Cylinder::new(rig).map_err(|error| ("unknown_cylinder", error.to_string()))?;
        self.cylinders.insert(name.to_owned(), cylinder);
        Ok(())
    }

    /// Time of a sample of the cylinder of this name, s since 1970, or as its sender counts.
    fn time_s(&mut self, fields: &Fields<'_>, name: &str) -> Option<f64> {
        let rig = rig_of(&self.config, &self.cylinders, name).ok()?;
        self.layouts.find(&fields.names, rig).ok()?.time_s(Some(0), &cells(fields))
    }
}

fn cells<'a>(fields: &'a Fields<'_>) -> Vec<&'a [u8]> {
    fields.cells.iter().map(|cell| cell.as_bytes()).collect()
}

/// The rig by which a cylinder is or would be watched.
fn rig_of<'a>(
    config: &'a LiveConfig,
    cylinders: &'a BTreeMap<String, Cylinder>,
    name: &str,
) -> Result<&'a Rig, Refusal> {
    if let Some(cylinder) = cylinders.get(name) {
        return Ok(cylinder.rig());
    }
    let shown = || shorten(name, 40);
    let full = cylinders.len() >= config.most_cylinders;
    if full || name.len() > LONGEST_NAME || name.contains(char::is_control) {
        return Err(("too_many_cylinders", format!("`{}` is left out", shown())));
    }
    config.rig_of(name).ok_or_else(|| ("unknown_cylinder", format!("`{}` has no rig", shown())))
}
