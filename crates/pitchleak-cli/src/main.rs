//! The program `pitchleak`.
fn main() {}
