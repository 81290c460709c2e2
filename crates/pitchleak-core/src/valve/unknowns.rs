//! What is not known of a cylinder and its valve: where each stands in a calibration's mean and covariance, and its unit.

/// How many there are.
pub const VALVE_UNKNOWNS: usize = 23;
/// Entries of a lower triangle, row by row, of their covariances.
pub const VALVE_COVARIANCES: usize = VALVE_UNKNOWNS * (VALVE_UNKNOWNS + 1) / 2;

/// C_ip, C_epA, C_epB, L/min at 50 bar.
pub const LEAKS: usize = 0;
/// κ = 1/β, in the rig's.
pub const KAPPA: usize = 3;
/// K₁ … K₄, in the data sheet's.
pub const GAINS: usize = 4;
/// d₁ … d₄, shares of the stroke.
pub const LAPS: usize = 8;
/// w, a share of the stroke.
pub const ROUNDING: usize = 12;
/// c of full openings.
pub const SATURATION: usize = 13;
/// What the tank's pressure is off by, bar.
pub const TANK: usize = 14;
/// By how much the spool's reading is late, ms.
pub const LAG: usize = 15;
/// l₁ … l₄, L/min at 50 bar.
pub const CLEARANCES: usize = 16;
/// Half width of the hysteresis, a share of the stroke.
pub const HYSTERESIS: usize = 20;
/// What the supply's pressure is off by, bar.
pub const SUPPLY: usize = 21;
/// By how much the supply's pressure drops between its sensor and the valve at the rated flow, bar.
pub const DROOP: usize = 22;

/// Gains, clearances and oil change in so long as is declared, s: a day; the spool's zero, which follows the oil's temperature, in ten
/// minutes. Chosen.
pub const DRIFT_S: f64 = 86_400.0;
/// See [`DRIFT_S`].
pub const NULL_DRIFT_S: f64 = 600.0;
/// What the tank's pressure is off by, and how far it goes in a day, 1 σ, bar: a guess.
pub const TANK_STD_BAR: f64 = 1.0;
/// Below this drop an edge turns laminar, Pa.
pub const LAMINAR_PA: f64 = 1e4;

/// 1 L/min at 50 bar, m³/(s·Pa).
pub const LEAK_UNIT_M3SPA: f64 = 1.0 / crate::LPM_PER_M3S / 50e5;
/// Of the pressures among them.
pub const PA_PER_BAR: f64 = 1e5;
/// Of the lag.
pub const S_PER_MS: f64 = 1e-3;
