//! Rig files.

/// The paper's cylinder and oil. Sensors are the paper's where a rig file names none.
pub const PAPER: &str = r#"[cylinder]
area_a = "12.6 cm^2"
area_b = "9.4 cm^2"
stroke = "0.2 m"
moving_mass = "20 kg"
[fluid]
bulk_modulus = "0.8 GPa"
bulk_modulus_std = "0.2 GPa"
"#;

/// The paper's rig with sensors of this accuracy, for instance `"0.1 %"`.
pub fn with_sensors_of(accuracy: &str) -> String {
    format!(
        r#"{PAPER}[sensors]
flow = {{ full_scale = "20 L/min", accuracy = "{accuracy}", bias = "0 %", gain = "0 %" }}
pressure = {{ full_scale = "16 MPa", accuracy = "{accuracy}" }}
position = {{ full_scale = "0.2 m", accuracy = "{accuracy}" }}
force = {{ full_scale = "10 kN", accuracy = "{accuracy}" }}
"#
    )
}

/// Sensors of 0.3 %, a valve of 4 L/min at 35 bar known by its data sheet, and what else `[valve]` says.
pub fn with_valve(valve: &str) -> String {
    format!(
        r#"
[cylinder]
area_a = "12.6 cm^2"
area_b = "9.4 cm^2"
stroke = "0.2 m"
moving_mass = "60 kg"
dead_volume_a = "50 mL"
dead_volume_b = "50 mL"
[fluid]
bulk_modulus = "0.8 GPa"
bulk_modulus_std = "0.2 GPa"
[sensors]
pressure = {{ full_scale = "160 bar", accuracy = "0.3 %" }}
position = {{ full_scale = "0.2 m", accuracy = "0.3 %" }}
spool = {{ accuracy = "0.3 %" }}
[valve]
rated_flow = "4 L/min"
rated_drop = "35 bar"
tank = "2 bar"
{valve}"#
    )
}
