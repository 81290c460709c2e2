//! How large what is not as declared is, in people's units.

use super::columns::Column;
use super::readings::Mistake;
use super::table::{Entry, USUAL_GAIN};
use crate::report::with_interval;
use crate::rig::Rig;
use crate::units::LPM_PER_M3S;
use pitchleak_core::Estimate;

/// A column of an explanation, and what was found of it in its own unit.
pub(super) type Found = (Column, Estimate<f64>);

/// An entry's sentence with the sizes of its columns.
pub(super) fn sentence(entry: &Entry, found: &[Found], rig: &Rig) -> String {
    if let Some(Mistake::Factor(_, factor) | Mistake::Area(_, factor) | Mistake::Clock(factor)) =
        entry.mistake
    {
        let (times, way) = if factor > 1.0 { (factor, "large") } else { (1.0 / factor, "small") };
        return format!("{}: {} times too {way}", entry.text, (100.0 * times).round() / 100.0);
    }
    // How much of the pressures' changes is noise is no size of a sensor's error.
    let sized = entry.free.iter().filter(|(column, ..)| *column != Column::Unpressed);
    let own = sized.filter_map(|(column, _, _)| {
        let (_, size) = found.iter().find(|(known, _)| known == column)?;
        Some((*column, *size))
    });
    let mut columns: Vec<Found> = Vec::new();
    for one in own.filter(|(_, size)| size.value.abs() > size.std) {
        if !columns.iter().any(|(known, _)| *known == one.0) {
            columns.push(one);
        }
    }
    let mut words = entry.text;
    if let [(column, size)] = columns.as_mut_slice()
        && let Some(other) = late_instead(*column).filter(|_| size.value < 0.0)
    {
        (words, size.value) = (other, -size.value);
    }
    let several = columns.len() > 1;
    let sizes: Vec<String> =
        columns.iter().map(|(column, size)| text(*column, *size, rig, several)).collect();
    if sizes.is_empty() { words.to_owned() } else { format!("{words} by {}", sizes.join(" and ")) }
}

/// Whether all that was found is a meter that reads more one way than the other by less than its usual gain is off: no news of it.
pub(super) fn is_usual_direction(entry: &Entry, found: &[Found]) -> bool {
    let is_direction = |column: &Column| matches!(column, Column::DirectionA | Column::DirectionB);
    let is_small =
        |column: &Column| found.iter().any(|(known, size)| known == column && size.value.abs() < USUAL_GAIN);
    let mut columns = entry.free.iter().map(|(column, ..)| column);
    !entry.free.is_empty() && columns.all(|column| is_direction(column) && is_small(column))
}

/// What lags where a flow meter's lag is below zero.
fn late_instead(column: Column) -> Option<&'static str> {
    match column {
        Column::LagA => Some("position and pressures lag behind flow meter A"),
        Column::LagB => Some("position and pressures lag behind flow meter B"),
        Column::Lags => Some("position and pressures lag behind both flow meters"),
        _ => None,
    }
}

/// Declared area, as it would have to be; other entries' lines name columns that only the trace's reader knows.
pub(super) fn mended(entry: &Entry, found: &[Found], rig: &Rig) -> Vec<String> {
    let of = |column: Column| {
        found.iter().find(|(known, _)| *known == column).map(|(_, size)| over_declared(*size).value)
    };
    let declared = [(Column::AreaA, rig.cylinder.area_a_m2), (Column::AreaB, rig.cylinder.area_b_m2)];
    let area = declared.into_iter().find_map(|(column, area_m2)| Some(1e4 * area_m2 * of(column)?));
    let line = entry.mends.filter(|_| matches!(entry.id, "area_a" | "area_b")).zip(area);
    line.map(|(line, area_cm2)| line.replace("{}", &format!("{area_cm2:.2}"))).into_iter().collect()
}

/// A true size over the declared one, where it is larger by this share of itself.
pub(super) fn over_declared(share: Estimate<f64>) -> Estimate<f64> {
    let rest = 1.0 - share.value;
    Estimate { value: 1.0 / rest, std: share.std / rest.powi(2) }
}

/// What is found as a share of a reading or of the true size, as a share of what was declared.
fn of_the_declared(column: Column, size: Estimate<f64>) -> Estimate<f64> {
    use Column as C;
    match column {
        C::GainA | C::GainB | C::Gains | C::AreaA | C::AreaB | C::PressureGainA | C::PressureGainB => {
            let whole = over_declared(size);
            Estimate { value: whole.value - 1.0, ..whole }
        }
        C::PositionGain => Estimate { value: -size.value, ..size },
        _ => size,
    }
}

fn text(column: Column, size: Estimate<f64>, rig: &Rig, several: bool) -> String {
    let sheets = &rig.instruments;
    let pressure_bar = 1e-5 * sheets.pressure.full_scale;
    let cylinder = &rig.cylinder;
    let swept_cm3 = |area_m2: f64| 1e6 * area_m2 * cylinder.stroke_m;
    let (factor, unit, which) = match column {
        Column::ZeroA => (LPM_PER_M3S * sheets.flow_a.full_scale, "L/min", "A"),
        Column::ZeroB => (LPM_PER_M3S * sheets.flow_b.full_scale, "L/min", "B"),
        Column::LagA => (1e3, "ms", "A"),
        Column::LagB => (1e3, "ms", "B"),
        Column::Lags => (1e3, "ms", "the lag"),
        Column::DeadVolumeA => (swept_cm3(cylinder.area_a_m2), "cm³", "A"),
        Column::DeadVolumeB => (swept_cm3(cylinder.area_b_m2), "cm³", "B"),
        Column::PositionZero => (1e3 * cylinder.stroke_m, "mm", "x"),
        Column::PressureZeroA => (pressure_bar, "bar", "A"),
        Column::PressureZeroB => (pressure_bar, "bar", "B"),
        Column::GainA | Column::AreaA | Column::PressureGainA => (100.0, "%", "A"),
        Column::GainB | Column::AreaB | Column::PressureGainB => (100.0, "%", "B"),
        _ => (100.0, "%", "both"),
    };
    let size = of_the_declared(column, size).scaled(factor);
    let interval = with_interval(size.value, Some(size.std.abs()));
    if several { format!("{interval} {unit} ({which})") } else { format!("{interval} {unit}") }
}

#[cfg(test)]
mod tests {
    use super::super::table::explanations;
    use super::*;

    #[test]
    fn no_meter_lags_by_less_than_nothing() {
        let all = explanations();
        let entry = all.iter().find(|one| one.id == "flow_lag_a").expect("is in the table");
        let told =
            |s: f64| sentence(entry, &[(Column::LagA, Estimate { value: s, std: 0.001 })], &Rig::paper());
        assert!(told(0.065).starts_with("flow meter A lags by 65"), "{}", told(0.065));
        assert!(
            told(-0.065).starts_with("position and pressures lag behind flow meter A by 65"),
            "{}",
            told(-0.065)
        );
    }
}
