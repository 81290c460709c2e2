//! Headers as columns of a trace: by the names of the contract, those of `[columns]`, and foreign ones that name signal and
//! unit.

use super::columns::{Content, Layout, REQUIRED, doubled, mapped, standard};
use super::error::TraceFault;
use super::table_text::{TextRow, bare_unit, column};
use crate::header::{self, HeaderUnit, shorten};
use crate::rig::{ColumnMap, ForeignColumn, Rig};
use crate::signal::Signal;
use crate::times::{self, TimeFault, Zone};

/// What the columns of a file hold.
pub(super) struct Bound {
    pub(super) layout: Layout,
    /// Signals that were found by a foreign header, and the headers.
    pub(super) foreign: ColumnMap,
}

/// Binds `headers`; `units` is the row below them, and `rows` are the first ones.
pub(super) fn bind(
    headers: &[String],
    units: Option<&[String]>,
    rows: &[TextRow],
    rig: &Rig,
) -> Result<Bound, TraceFault> {
    let mut foreign = ColumnMap::new();
    for (index, header) in headers.iter().enumerate() {
        let unit = units.and_then(|units| units.get(index)).map(|unit| bare_unit(unit)).unwrap_or_default();
        if let Some(known) = known(header, rig) {
            check_unit(header, known, unit)?;
            continue;
        }
        let Some((signal, found)) = plain(header, unit, &column(rows, index)) else { continue };
        let is_given = rig.columns.contains_key(&signal)
            || headers.iter().any(|header| known(header, rig).is_some_and(|known| known.signal == signal));
        if is_given {
            continue;
        }
        if let Some(first) = foreign.insert(signal, found) {
            return Err(doubled(signal, &first.name, header));
        }
    }
    let mut map = rig.columns.clone();
    map.extend(foreign.clone());
    let required = if rig.csv.part.is_some() { &REQUIRED[..1] } else { &REQUIRED[..] };
    Ok(Bound { layout: Layout::new(headers, &map, required, rig)?, foreign })
}

/// What a channel is called whose name is its file's.
const NAMELESS: [&str; 5] = ["value", "values", "wert", "data", "y"];

/// Names the channel of a file that holds one.
pub(super) fn name_part(headers: &mut [String], rig: &Rig) {
    let Some(part) = &rig.csv.part else { return };
    let is_nameless = |header: &&mut String| NAMELESS.contains(&header.trim().to_lowercase().as_str());
    headers.iter_mut().filter(is_nameless).for_each(|header| header.clone_from(part));
}

/// What a header says that the contract or the rig file names; the unit is that of the file's numbers.
fn known(header: &str, rig: &Rig) -> Option<Content> {
    match mapped(header, &rig.columns) {
        Some((signal, column)) => Some(Content { signal, unit: column.unit }),
        None => standard(header),
    }
}

/// The row of units and the header must say the same.
fn check_unit(header: &str, known: Content, unit: &str) -> Result<(), TraceFault> {
    let found = known.signal.dimension().and_then(|dimension| HeaderUnit::by_name(unit, dimension));
    let (Some(bound), Some(found)) = (known.unit, found) else { return Ok(()) };
    if (found.unit.over(&bound) - 1.0).abs() < 1e-9 && found.offset_si.abs() < 1e-9 {
        return Ok(());
    }
    let header = shorten(header, 40);
    Err(TraceFault::Ambiguous {
        what: format!(
            "column `{header}` is read in {}, and the row of units says {}",
            bound.text,
            shorten(unit, 20)
        ),
        settle: "take that row out, or correct it or the name".to_owned(),
    })
}

/// What a foreign header says without a doubt, together with the unit below it.
fn plain(header: &str, unit: &str, cells: &[&str]) -> Option<(Signal, ForeignColumn)> {
    let name_and_unit = |name: &str, unit: &str| {
        let signal = header::signal(name)?;
        let found = HeaderUnit::by_name(unit, signal.dimension()?)?;
        Some((signal, ForeignColumn::with_unit(header, found)))
    };
    name_and_unit(header, unit)
        .or_else(|| header::parts(header).find_map(|(name, unit)| name_and_unit(name, unit)))
        .or_else(|| plain_time(header, cells))
}

/// A column called time whose cells are times of day, dates or epochs; its header may name the zone.
fn plain_time(header: &str, cells: &[&str]) -> Option<(Signal, ForeignColumn)> {
    let is_time = |name: &str| header::signal(name).is_some_and(Signal::is_time);
    let behind = header::parts(header).find(|(name, _)| is_time(name)).map(|(_, behind)| behind);
    if behind.is_none() && !is_time(header) {
        return None;
    }
    match times::guess(cells) {
        Err(TimeFault::BareNumber(_) | TimeFault::Unknown(_)) => None,
        Ok(_) | Err(_) => {
            let zone = behind.and_then(Zone::by_name);
            Some((Signal::Timestamp, ForeignColumn { zone, ..ForeignColumn::new(header, None) }))
        }
    }
}
