//! Files that are given in a trace's place by mistake, and what to do with each: asked only where no trace was found.

use super::encoding::text;
use super::error::TraceFault;

/// What a file shows of itself; in small letters.
struct Shown {
    /// How it begins.
    begins: &'static str,
    /// What stands in its first lines.
    holds: &'static str,
    /// What it is, and what to give.
    line: &'static str,
}

/// The first that fits is taken.
const KINDS: &[Shown] = &[
    Shown {
        begins: "",
        holds: "\n[cylinder]",
        line: "a rig file, not a trace: give it by `--rig FILE`, and the trace in its place",
    },
    Shown {
        begins: "{",
        holds: "\"pitchleak.simulate/",
        line: "what is true of a simulated trace, not the trace: that is the file that `simulate --out` wrote beside it",
    },
    Shown {
        begins: "{",
        holds: "\"pitchleak.",
        line: "a result of pitchleak (`--json`), not a trace: give the trace that it is of",
    },
    Shown {
        begins: "{\"type\":",
        holds: "",
        line: "what `pitchleak watch` wrote, not a trace: give the samples that it read",
    },
    Shown {
        begins: "{",
        holds: "",
        line: "JSON, not a table: `pitchleak watch` reads samples in lines of JSON; here give CSV, Parquet or MAT",
    },
    Shown {
        begins: "<",
        holds: "content=\"pitchleak ",
        line: "a report of pitchleak for a browser, not a trace: give the trace that it is of",
    },
    Shown { begins: "<", holds: "<html", line: "a page for a browser (HTML), not a trace: export it as CSV" },
    Shown {
        begins: "t_s,internal_leak_coefficient,",
        holds: "",
        line: "estimates that `replay --out` wrote, not a trace: give the trace that they are of",
    },
    Shown {
        begins: "cylinder,path,begins,rig,status,",
        holds: "",
        line: "a table that `fleet --out` wrote, not a trace: give the traces that it is of",
    },
    Shown {
        begins: "mdf     ",
        holds: "",
        line: "MDF, a measurement file: export it as CSV; in Python, examples/mdf4_and_tdms.py reads it",
    },
    Shown {
        begins: "trace,rig",
        holds: ".toml",
        line: "a table of rig files, not a trace: `pitchleak fleet` reads it by `--rig FILE`",
    },
];

/// What a file is that begins so, where that is plain.
pub(super) fn mistaken(start: &[u8]) -> Option<TraceFault> {
    let start = format!("\n{}", text(start).trim_start_matches('\u{feff}').trim_start().to_lowercase());
    let fits = |kind: &&Shown| start[1..].starts_with(kind.begins) && start.contains(kind.holds);
    KINDS.iter().find(fits).map(|kind| TraceFault::Format(kind.line))
}
