use super::config::LiveConfig;
use super::cylinder::{Cylinder, Line};
use super::event::{Event, NoticeEvent, Notices};
use super::format::{Batch, Fields, LineFormat, Parser, parse_batch};
use super::{checkpoint, record};
use crate::Rig;
use crate::header::shorten;
use crate::trace::LineLayout;
use crate::units::S_PER_DAY;
use pitchleak_core::PerLeak;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io;

/// Watches many cylinders, line by line or message by message.
pub struct Watch {
    config: LiveConfig,
    parser: Option<Parser>,
    layouts: Layouts,
    pub(super) cylinders: BTreeMap<String, Cylinder>,
    /// No longer watched since a [`reload`](Self::reload), and in no [`Snapshot`](super::Snapshot) yet.
    pub(super) gone: BTreeMap<String, Cylinder>,
    /// Begun anew since, because their rigs are others: their states as they were.
    pub(super) replaced: BTreeMap<String, Cylinder>,
    /// Of lines that belong to no cylinder.
    notices: Notices,
    /// What cylinders left out that are gone, by kind.
    left_out_before: BTreeMap<String, u64>,
    lines: u64,
}

/// Kind of the notices of what is no line, no sample or no message.
const UNREADABLE: &str = "unreadable";

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
            gone: BTreeMap::new(),
            replaced: BTreeMap::new(),
            notices: Notices::default(),
            left_out_before: BTreeMap::new(),
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

    /// Their names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.cylinders.keys().map(String::as_str)
    }

    /// Mean flow of each leak of a cylinder on each of the last 90 days that are over, L/min: the day's begin, s since 1970
    /// or as the samples count, and the leaks.
    pub fn days(&self, cylinder: &str) -> Vec<(f64, PerLeak<f64>)> {
        let days = self.cylinders.get(cylinder).into_iter().flat_map(|cylinder| cylinder.history.days());
        days.map(|(day, mean_lpm)| (day * S_PER_DAY, mean_lpm)).collect()
    }

    /// How many samples, lines and messages were left out, by kind, each counted at once.
    pub fn left_out(&self) -> BTreeMap<String, u64> {
        let mut all = self.left_out_before.clone();
        let each = self.cylinders.values().flat_map(|cylinder| cylinder.notices.totals());
        each.chain(self.notices.totals()).for_each(|(kind, count)| add(&mut all, kind, count));
        all
    }

    /// Goes on by another configuration. Cylinders whose rigs are the same, by whatever name, know nothing of it; one whose
    /// rig is another begins anew, one that is in it no more is forgotten, and both are said. Their states go with the next
    /// [`Snapshot`](super::Snapshot).
    pub fn reload(&mut self, config: LiveConfig, events: &mut Vec<Event>) {
        self.config = config;
        // A rig's columns may be others.
        self.layouts = Layouts::default();
        for (name, mut cylinder) in std::mem::take(&mut self.cylinders) {
            let rig = self.config.rig_of(&name);
            if rig.is_some_and(|rig| cylinder.is_of(rig)) {
                self.cylinders.insert(name, cylinder);
                continue;
            }
            cylinder.tell_counted(&name, events);
            cylinder.notices.totals().for_each(|(kind, count)| add(&mut self.left_out_before, kind, count));
            let (text, place) = match rig {
                Some(_) => ("its rig is another: it begins anew", &mut self.replaced),
                None => ("it is watched no more", &mut self.gone),
            };
            events.push(Event::Notice(NoticeEvent::once(name.clone(), "reload", text.to_owned())));
            place.insert(name, cylinder);
        }
        for (name, mut cylinder) in std::mem::take(&mut self.gone) {
            cylinder.changed = true;
            let is_back = self.config.rig_of(&name).is_some_and(|rig| cylinder.is_of(rig));
            let place = if is_back { &mut self.cylinders } else { &mut self.gone };
            place.insert(name, cylinder);
        }
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
    /// message is an error: what is of no use is counted. Says what could not be read first, if something could not.
    pub fn take_batch(&mut self, batch: &Batch<'_>, events: &mut Vec<Event>) -> Option<String> {
        let samples = parse_batch(batch).unwrap_or_else(|why| vec![Err(why)]);
        let mut refusals: Vec<Refusal> = Vec::new();
        let mut in_turn = Vec::with_capacity(samples.len());
        for sample in samples {
            match sample {
                Ok(fields) => {
                    let t_s = self.time_s(&fields, fields.cylinder_or(batch.cylinder));
                    in_turn.push((t_s.unwrap_or(f64::INFINITY), fields));
                }
                Err(why) => refusals.push((UNREADABLE, why)),
            }
        }
        let unreadable = refusals.first().map(|(_, why)| why.clone());
        in_turn.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        for (_, fields) in &in_turn {
            self.lines += 1;
            let name = fields.cylinder_or(batch.cylinder);
            refusals.extend(self.take_fields(fields, name, None, batch.resent, events).err());
        }
        for (kind, text) in refusals {
            self.notice(kind, text, events);
        }
        unreadable
    }

    /// Each cylinder's state, as the first record of a checkpoint's file: of two that are alike it is the same.
    ///
    /// # Errors
    /// None in practice: every part has its form.
    pub fn states(&self) -> io::Result<BTreeMap<&str, Vec<u8>>> {
        self.cylinders
            .iter()
            .map(|(name, cylinder)| Ok((name.as_str(), record::whole(name, cylinder)?)))
            .collect()
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

    /// Says what was counted and not said: lines that belong to no cylinder and late ones have no time by which the next
    /// notice could be due.
    pub fn tell_counted(&mut self, events: &mut Vec<Event>) {
        for (name, cylinder) in &mut self.cylinders {
            cylinder.tell_counted(name, events);
        }
        events.extend(self.notices.rest("", [None; 2]).into_iter().map(Event::Notice));
    }

    fn take_line(&mut self, line: &[u8], events: &mut Vec<Event>) -> Result<(), Refusal> {
        let line = std::str::from_utf8(line).map_err(|_| (UNREADABLE, "not UTF-8".to_owned()))?;
        let mut parser = self.parser.take().unwrap_or_else(|| Parser::new(LineFormat::of(line)));
        let taken = match parser.parse(line) {
            Err(why) => Err((UNREADABLE, why)),
            Ok(None) => Ok(()),
            Ok(Some(fields)) => self.take_fields(&fields, &fields.cylinder, Some(self.lines), false, events),
        };
        self.parser = Some(parser);
        taken
    }

    /// Gives a sample to the cylinder of this name; says why, where there is none for it.
    fn take_fields(
        &mut self,
        fields: &Fields<'_>,
        name: &str,
        number: Option<u64>,
        resent: bool,
        events: &mut Vec<Event>,
    ) -> Result<(), Refusal> {
        if let Some(cylinder) = self.cylinders.get_mut(name) {
            match self.layouts.find(&fields.names, cylinder.rig()) {
                Ok(layout) => {
                    let line = Line { name, layout, number, cells: &cells(fields) };
                    cylinder.take(&self.config, resent, &line, events);
                }
                Err(why) => cylinder.notice(name, "columns", format!("line {}: {why}", self.lines), events),
            }
            return Ok(());
        }
        self.begin(fields, name)?;
        self.take_fields(fields, name, number, resent, events)
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
        self.layouts.find(&fields.names, rig).ok()?.time_s(Some(0), &cells(fields)).ok()
    }
}

fn add(counts: &mut BTreeMap<String, u64>, kind: &str, count: u64) {
    *counts.entry(kind.to_owned()).or_default() += count;
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
    if full || !checkpoint::can_name(name) {
        return Err(("too_many_cylinders", format!("`{}` is left out", shown())));
    }
    config.rig_of(name).ok_or_else(|| ("unknown_cylinder", format!("`{}` has no rig", shown())))
}

/// Sets of names that are remembered with what they mean.
const LAYOUTS: usize = 16;

/// What sets of names mean, the last used first.
#[derive(Default)]
struct Layouts(Vec<(String, Vec<String>, LineLayout)>);

impl Layouts {
    /// What cells of these names mean to a rig.
    fn find(&mut self, names: &[Cow<'_, str>], rig: &Rig) -> Result<&LineLayout, String> {
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
