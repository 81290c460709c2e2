//! The program with a real broker: TLS and password, killed at any moment, fed with what it cannot use, on a full disk.

#![allow(clippy::unwrap_used)]

mod broker;
mod disk;
mod harness;
mod page;
mod refused;
mod reload;
mod secrets;
mod systemd;
