//! The engine of pitchleak: traces, rig files, replay, scoring and reports around
//! [`pitchleak_core`].

pub use pitchleak_core as core;

pub mod check;
pub mod cramer_rao;
pub mod curve;
pub mod diagnose;
pub mod figure;
pub mod openfast;
pub mod reference;
pub mod replay;
pub mod report;
pub mod reproduce;
pub mod rig;
pub mod score;
pub mod signal;
pub mod simulate;
pub mod trace;
pub mod units;
pub mod wind;

pub use rig::Rig;
