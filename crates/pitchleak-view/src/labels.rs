//! Names and units for people.

use pitchleak::diagnose::Equation;
use pitchleak::report::with_interval;
use pitchleak::units::{LPM_PER_M3S, effect_unit};

/// Name of an equation in text and figures.
pub(crate) fn name(equation: Equation) -> &'static str {
    match equation {
        Equation::ChamberA => "chamber A",
        Equation::ChamberB => "chamber B",
        Equation::Force => "force",
    }
}

/// Factor from SI to people's unit of an equation's residual, and that unit.
pub(crate) fn people_unit(equation: Equation) -> (f64, &'static str) {
    if equation == Equation::Force { (1.0, "N") } else { (LPM_PER_M3S, "L/min") }
}

/// Name of a variable in text and figures.
pub(crate) fn symbol(variable: &str) -> &'static str {
    match variable {
        "load_pressure_pa" => "P_L",
        "pa_pa" => "P_A",
        "pb_pa" => "P_B",
        "x_m" => "x",
        "v_mps" => "speed",
        "direction" => "direction",
        "qa_m3s" => "Q_A",
        "qb_m3s" => "Q_B",
        "force_n" => "force",
        "temp_k" => "temperature",
        _ => "time",
    }
}

/// Factor to people's unit, and that unit.
pub(crate) fn people(variable: &str) -> (f64, &'static str) {
    match variable {
        "load_pressure_pa" | "pa_pa" | "pb_pa" => (1e-5, "bar"),
        "x_m" => (1e3, "mm"),
        "v_mps" => (1e3, "mm/s"),
        "qa_m3s" | "qb_m3s" => (LPM_PER_M3S, "L/min"),
        "force_n" => (1e-3, "kN"),
        "temp_k" => (1.0, "K"),
        "direction" => (1.0, ""),
        _ => (1.0, "s"),
    }
}

/// With its 95 % interval, in people's units.
pub(crate) fn quantity(value: f64, std: Option<f64>, unit: &str) -> String {
    let (factor, unit) = effect_unit(unit);
    let size = with_interval(value * factor, std.map(|std| std * factor));
    format!("{size} {}", unit.replace('*', "·"))
}
