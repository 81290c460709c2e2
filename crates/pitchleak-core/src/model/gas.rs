/// Standard atmosphere, Pa: gauge pressures count from here.
pub const ATMOSPHERE_PA: f64 = 101_325.0;

/// Absolute pressure below which no gas law is evaluated, Pa.
pub const LEAST_ABSOLUTE_PA: f64 = 1_000.0;
