//! Laws of the filters: what they are exact on, and what they forget.

#![allow(clippy::unwrap_used)]

use pitchleak_core::{FadingMemoryFilter, Momentum};

/// The recursion is the least-squares parabola through everything read so far, older samples weighted by
/// exp(−age/memory): the same by normal equations.
#[test]
fn a_fading_memory_is_discounted_least_squares() {
    let (memory_s, dt_s) = (0.03, 2e-3);
    let signal = |t: f64| 0.1 + (7.0 * t).sin() + 0.3 * (31.0 * t + 1.0).cos();
    let mut filter = FadingMemoryFilter::new(memory_s);
    let mut normal = nalgebra::Matrix3::zeros();
    let mut right = nalgebra::Vector3::zeros();
    let (count, now_s) = (1000_u32, 1000.0 * dt_s);
    for k in 0..=count {
        let t = f64::from(k) * dt_s;
        filter.update(dt_s, signal(t));
        let age_s = now_s - t;
        let row = nalgebra::Vector3::new(1.0, -age_s, 0.5 * age_s * age_s);
        let weight = (-age_s / memory_s).exp();
        normal += weight * row * row.transpose();
        right += weight * signal(t) * row;
    }
    let parabola = normal.lu().solve(&right).unwrap();
    for (found, expected) in [filter.value(), filter.slope(), filter.curvature()].iter().zip(&parabola) {
        assert!((found - expected).abs() < 1e-6 * expected.abs(), "{found} for {expected}");
    }
}

/// A step that is no step: what was read before counts for nothing any more.
#[test]
fn a_fading_memory_starts_anew() {
    for dt_s in [0.0, -1.0] {
        let mut filter = FadingMemoryFilter::new(0.02);
        for k in 0..100 {
            filter.update(0.01, 3.0 * f64::from(k));
        }
        filter.update(dt_s, 5.0);
        assert_eq!((filter.value(), filter.slope(), filter.curvature()), (5.0, 0.0, 0.0));
    }
}

/// A minute's pause in a uniform motion: the piston is elsewhere, its momentum is the same.
#[test]
fn a_gap_keeps_the_momentum() {
    let (mass_kg, speed_mps, dt_s) = (20.0, 0.03, 1e-3);
    let mut momentum = Momentum::new(mass_kg, 10.0);
    let mut last = 0.0;
    for k in 0..10_000 {
        last = momentum.update(dt_s, 0.0, speed_mps * f64::from(k) * dt_s);
    }
    assert!((last - mass_kg * speed_mps).abs() < 1e-9, "{last} N·s");
    let after_s = 70.0;
    momentum.restart(speed_mps * after_s);
    for k in 1..100 {
        let p = momentum.update(dt_s, 0.0, speed_mps * (after_s + f64::from(k) * dt_s));
        assert!((p - mass_kg * speed_mps).abs() < 1e-9, "{p} N·s");
    }
}
