"""All that the package offers."""

from ._check import ChannelFault, Check, Reach, Reading, Wiring, check
from ._diagnose import Diagnosis, diagnose
from ._estimator import Estimator
from ._fleet import Fleet, FleetLeak, FleetRow, LongTrend, fleet
from ._inputs import TraceWarning
from ._pitchleak import Linkage, Rig, RigError, TraceError, __version__
from ._replay import Replay, Replays, replay
from ._reproduce import Reproduction, reproduce
from ._results import (
    Alarm,
    Episode,
    Estimate,
    Estimates,
    HeldLeak,
    Hold,
    Leakage,
    OilShare,
    PerLeak,
    ReachTime,
    Reason,
    Score,
    Slope,
    Spell,
    Trace,
    Trend,
    Verdict,
)
from ._simulate import Simulation, simulate

__all__ = [
    "Alarm",
    "ChannelFault",
    "Check",
    "Diagnosis",
    "Episode",
    "Estimate",
    "Estimates",
    "Estimator",
    "Fleet",
    "FleetLeak",
    "FleetRow",
    "HeldLeak",
    "Hold",
    "Leakage",
    "Linkage",
    "LongTrend",
    "OilShare",
    "PerLeak",
    "Reach",
    "ReachTime",
    "Reading",
    "Reason",
    "Replay",
    "Replays",
    "Reproduction",
    "Rig",
    "RigError",
    "Score",
    "Simulation",
    "Slope",
    "Spell",
    "Trace",
    "TraceError",
    "TraceWarning",
    "Trend",
    "Verdict",
    "Wiring",
    "__version__",
    "check",
    "diagnose",
    "fleet",
    "replay",
    "reproduce",
    "simulate",
]
