//! Any bytes as the file that a simulation follows: numbers, or a typed error.

use super::scratch;
use pitchleak::reference::read_curve;
use pitchleak::units::Dimension;

pub fn enter(bytes: &[u8]) {
    let path = scratch::file("followed", bytes);
    for (signal, dimension) in [("x", Dimension::Length), ("force", Dimension::Force)] {
        let Ok(curve) = read_curve(&path, signal, dimension) else { continue };
        let (from_s, to_s) = curve.span_s();
        for share in [-1.0, 0.0, 0.1, 0.5, 1.0, 2.0] {
            let _ = curve.at(from_s + share * (to_s - from_s));
        }
    }
}
