//! Leaks that are put into a trace are found at the sizes that its flows allow, and none is called another.

#![allow(clippy::unwrap_used)]

use pitchleak::Rig;
use pitchleak::core::{Leak, PerLeak, Sample};
use pitchleak::prove::{Proof, ProveError, prove};
use pitchleak::replay::ReplayError;
use pitchleak::simulate::{Biases, Sensing};
use pitchleak::trace::{TraceError, TraceReader};
use pitchleak::wind::WindCase;
use pitchleak_testkit::windy::minute;
use rayon::prelude::*;
use std::fmt::Write;
use std::io::Cursor;

fn row(text: &mut String, t_s: f64, sample: &Sample<f64>) {
    let Sample { x_m, pa_pa, pb_pa, qa_m3s, qb_m3s, .. } = sample;
    let _ = writeln!(
        text,
        "{t_s:.3},{x_m:.9},{pa_pa:.2},{pb_pa:.2},{:.6e},{:.6e}",
        qa_m3s.unwrap(),
        qb_m3s.unwrap()
    );
}

const HEADER: &str = "t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s\n";

/// A minute at 100 Hz.
fn trace(wind: WindCase, leak: Option<Leak>, seed: u64) -> String {
    let mut text = HEADER.to_owned();
    for (t_s, sample) in minute(wind, leak.map(|leak| (leak, 0.3)), seed) {
        row(&mut text, t_s, &sample);
    }
    text
}

fn proof(text: &str, sizes_lpm: &PerLeak<Vec<f64>>) -> Result<Proof, ProveError> {
    let rig = Rig::paper();
    let open = || {
        let text = Box::new(Cursor::new(text.to_owned()));
        let reader: Result<_, TraceError> = TraceReader::from_stream("trace", text, &rig);
        reader.map_err(|error| ProveError::from(ReplayError::from(error)))
    };
    prove(open, &rig, sizes_lpm, || {})
}

/// Ten sound and ten leaking traces. Sizes within 1.3 times the Cramér–Rao bound of their flows.
#[test]
fn leaks_are_found_from_the_size_that_the_flows_allow() {
    let leaks = [None, Some(Leak::Internal), Some(Leak::ExternalA), None, Some(Leak::ExternalB)];
    let cases: Vec<_> = WindCase::ALL
        .into_iter()
        .enumerate()
        .flat_map(|(at, wind)| {
            leaks.into_iter().zip(0..).map(move |(leak, k)| (wind, leak, 900 + 10 * at as u64 + k))
        })
        .collect();
    assert_eq!(cases.len(), 20);
    let worst = cases.into_par_iter().map(|(wind, leak, seed)| {
        let proof = proof(&trace(wind, leak, seed), &PerLeak::default()).unwrap();
        let at = format!("{wind:?}, {leak:?}, seed {seed}");
        let recorded: Vec<Leak> = leak.into_iter().collect();
        assert_eq!(proof.verdict.faults, recorded, "{at}: {}", proof.verdict.text);
        for case in &proof.cases {
            assert!(case.wrongly_named.is_empty(), "{at}: {case:?}");
        }
        let ratio = |(which, least): (Leak, &pitchleak::prove::Least)| {
            assert!(least.reason.is_none(), "{at}, {which:?}: {least:?}");
            // What grows beside a leak is told from that leak, and not from none.
            if leak == Some(which) {
                0.0
            } else {
                least.lpm.unwrap_or(f64::INFINITY) / least.bound_lpm.unwrap()
            }
        };
        let worst = proof.found_from.iter().map(ratio).fold(0.0, f64::max);
        let found = proof.cases.iter().filter(|case| case.found).count();
        println!("{at}: {found} of {} found, from {worst:.2} times the bound", proof.cases.len());
        (worst, found, proof.cases.len())
    });
    let all: Vec<_> = worst.collect();
    let (found, put_in) = all.iter().fold((0, 0), |sum, (_, found, put_in)| (sum.0 + found, sum.1 + put_in));
    assert!(100 * found >= 95 * put_in, "{found} of {put_in}");
    let within = all.iter().filter(|(worst, _, _)| *worst <= 1.3).count();
    assert!(within >= 18, "{within} of 20 traces within 1.3 times the bound");
}

/// Sizes that are asked for, each alone.
#[test]
fn asked_for_sizes_are_put_in() {
    let sizes = PerLeak { external_b: vec![0.3, 1.0], ..PerLeak::default() };
    let proof = proof(&trace(WindCase::Mps13, None, 3), &sizes).unwrap();
    let put_in: Vec<_> = proof.cases.iter().map(|case| (case.leak, case.put_in_lpm, case.found)).collect();
    assert_eq!(put_in, [(Leak::ExternalB, 0.3, true), (Leak::ExternalB, 1.0, true)]);
    for case in &proof.cases {
        let std_lpm = case.std_lpm.unwrap();
        assert!((case.found_lpm - case.put_in_lpm).abs() < 4.0 * std_lpm, "{case:?}");
        assert!(case.alarm_after_s.unwrap() >= case.bound_after_s.unwrap(), "{case:?}");
    }
}

/// At rest, with noise alone about constant pressures, a flow that sets in is the leak that it can be, at its size.
#[test]
fn at_rest_a_leak_that_begins_is_found_at_its_size() {
    let mut sensing = Sensing::new(Rig::paper().sensors(), Biases::default(), 11);
    let mut text = HEADER.to_owned();
    for k in 0..6000 {
        let still = Sample {
            x_m: 0.1,
            pa_pa: 53.4e5,
            pb_pa: 50.3e5,
            qa_m3s: Some(0.0),
            qb_m3s: Some(0.0),
            force_n: None,
        };
        row(&mut text, 0.01 * f64::from(k), &sensing.read(&still));
    }
    let proof = proof(&text, &PerLeak::default()).unwrap();
    for case in &proof.cases {
        assert!(case.found && case.wrongly_named.is_empty(), "{case:?}");
    }
}

#[test]
fn what_shows_no_leak_is_told() {
    let text = trace(WindCase::Mps13, None, 5);
    let cut = |columns: usize| -> String {
        text.lines().map(|line| line.split(',').take(columns).collect::<Vec<_>>().join(",") + "\n").collect()
    };
    assert!(matches!(proof(&cut(4), &PerLeak::default()), Err(ProveError::NoFlows(_))));
    let one = proof(&cut(5), &PerLeak::default()).unwrap();
    assert_eq!(one.found_from.external_b.reason, Some("no flow into chamber B is measured"));
    assert!(one.cases.iter().all(|case| case.leak != Leak::ExternalB));
}
