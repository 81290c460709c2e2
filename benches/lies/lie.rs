//! What sensors, wires and recorders do to an honest trace.

/// How a trace with a lie has to be judged.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Family {
    /// Nothing is wrong: right and sure.
    Honest,
    /// Something else than usual, but no reason to be unsure: right and sure.
    Harmless,
    /// A meter's zero is off and nobody said so: right or in doubt.
    Offset,
    /// A mistake: right or in doubt.
    Mistake,
}

impl Family {
    pub const ALL: [Self; 4] = [Self::Honest, Self::Harmless, Self::Offset, Self::Mistake];

    pub fn name(self) -> &'static str {
        match self {
            Self::Honest => "honest",
            Self::Harmless => "harmless",
            Self::Offset => "offset",
            Self::Mistake => "mistake",
        }
    }
}

/// One lie.
#[derive(Clone, Copy, Debug)]
pub struct Lie {
    pub family: Family,
    pub name: &'static str,
    /// As `pitchleak simulate --fault` takes them.
    pub faults: &'static [&'static str],
    /// One of so many rows is recorded.
    pub every: usize,
}

const fn lie(family: Family, name: &'static str, faults: &'static [&'static str]) -> Lie {
    Lie { family, name, faults, every: 1 }
}

const fn mistake(name: &'static str, faults: &'static [&'static str]) -> Lie {
    lie(Family::Mistake, name, faults)
}

const fn harmless(name: &'static str, faults: &'static [&'static str]) -> Lie {
    lie(Family::Harmless, name, faults)
}

const fn offset(name: &'static str, faults: &'static [&'static str]) -> Lie {
    lie(Family::Offset, name, faults)
}

/// Every lie of the bench; a trace lasts 60 s.
pub const LIES: &[Lie] = &[
    lie(Family::Honest, "nothing", &[]),
    harmless("no force column", &["force missing"]),
    Lie { every: 5, ..harmless("20 Hz", &[]) },
    harmless("rows lost", &["rows lost 5 %"]),
    harmless("spikes", &["pa spikes 0.1 %", "qa spikes 0.1 %"]),
    harmless("a gap", &["rows lost 20 s..25 s"]),
    harmless("absolute pressure", &["pa offset 1.01325 bar", "pb offset 1.01325 bar"]),
    harmless("half the length", &["rows lost 30 s.."]),
    offset("qa +0.5 %", &["qa offset 0.5 %"]),
    offset("qa +1 %", &["qa offset 1 %"]),
    offset("qa +2 %", &["qa offset 2 %"]),
    offset("qa -1 %", &["qa offset -1 %"]),
    offset("qb +0.5 %", &["qb offset 0.5 %"]),
    offset("qb +1 %", &["qb offset 1 %"]),
    offset("qb +2 %", &["qb offset 2 %"]),
    mistake("qa dead", &["qa dead"]),
    mistake("qb dead", &["qb dead"]),
    mistake("pa dead", &["pa dead"]),
    mistake("pb dead", &["pb dead"]),
    mistake("x dead", &["x dead"]),
    mistake("qa stuck", &["qa stuck"]),
    mistake("qb stuck", &["qb stuck"]),
    mistake("pa stuck", &["pa stuck"]),
    mistake("pb stuck", &["pb stuck"]),
    mistake("x stuck", &["x stuck"]),
    mistake("qa half stuck", &["qa stuck 30 s.."]),
    mistake("pa half stuck", &["pa stuck 30 s.."]),
    mistake("x half stuck", &["x stuck 30 s.."]),
    mistake("qa and qb swapped", &["swap qa qb"]),
    mistake("pa and pb swapped", &["swap pa pb"]),
    mistake("all of A and B swapped", &["swap qa qb", "swap pa pb"]),
    mistake("qa wrong sign", &["qa reversed"]),
    mistake("qb wrong sign", &["qb reversed"]),
    mistake("both flows wrong sign", &["qa reversed", "qb reversed"]),
    mistake("qa without sign", &["qa absolute"]),
    mistake("qb without sign", &["qb absolute"]),
    mistake("both flows without sign", &["qa absolute", "qb absolute"]),
    mistake("x from the other end", &["x other_end"]),
    mistake("pa in psi", &["pa in psi"]),
    mistake("both pressures in psi", &["pa in psi", "pb in psi"]),
    mistake("both pressures times 10", &["pa times 10", "pb times 10"]),
    mistake("qa in m3/h", &["qa in m3/h"]),
    mistake("both flows in m3/h", &["qa in m3/h", "qb in m3/h"]),
    mistake("qa in gal/min", &["qa in gal/min"]),
    mistake("both flows in gal/min", &["qa in gal/min", "qb in gal/min"]),
    mistake("both flows times 10", &["qa times 10", "qb times 10"]),
    mistake("x in cm", &["x in cm"]),
    mistake("t in ms", &["t in ms"]),
    mistake("flows 100 ms late", &["qa late 100 ms", "qb late 100 ms"]),
    mistake("pressures 100 ms late", &["pa late 100 ms", "pb late 100 ms"]),
    mistake("x 100 ms late", &["x late 100 ms"]),
    mistake("qa clipped", &["qa clipped 1 L/min"]),
    mistake("pa clipped", &["pa clipped 40 bar"]),
    mistake("qa held", &["qa held 500 ms"]),
    mistake("x held", &["x held 500 ms"]),
    mistake("qa 20 % gain", &["qa gain 20 %"]),
    mistake("qb 20 % gain", &["qb gain 20 %"]),
    mistake("pa 10 bar zero", &["pa offset 10 bar"]),
    mistake("pb 10 bar zero", &["pb offset 10 bar"]),
];
