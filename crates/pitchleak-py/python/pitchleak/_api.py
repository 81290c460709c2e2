"""All that the package offers."""

from ._calibrate import Calibration, calibrate
from ._check import ChannelFault, Check, Reach, Reading, Wiring, check
from ._diagnose import Diagnosis, diagnose
from ._estimator import Estimator
from ._explanations import Explanation, explanations
from ._fleet import Beside, CylinderLeak, Fleet, FleetCylinder, FleetLeak, FleetRow, LongTrend, fleet
from ._inputs import TraceWarning
from ._pitchleak import Linkage, Rig, RigError, TraceError, __version__
from ._prove import LeastLeak, Proof, PutIn, prove
from ._replay import Replay, Replays, replay
from ._reproduce import Reproduction, reproduce
from ._results import (
    Alarm,
    Episode,
    Estimate,
    Estimates,
    Explained,
    FoundLeak,
    Hold,
    Leakage,
    OilShare,
    PerLeak,
    ReachTime,
    Reason,
    Score,
    Since,
    Slope,
    Spell,
    Trace,
    Trend,
    Valve,
    Verdict,
)
from ._simulate import Simulation, simulate

__all__ = [
    "Alarm",
    "Beside",
    "Calibration",
    "ChannelFault",
    "Check",
    "CylinderLeak",
    "Diagnosis",
    "Episode",
    "Estimate",
    "Estimates",
    "Estimator",
    "Explained",
    "Explanation",
    "Fleet",
    "FleetCylinder",
    "FleetLeak",
    "FleetRow",
    "FoundLeak",
    "Hold",
    "Leakage",
    "LeastLeak",
    "Linkage",
    "LongTrend",
    "OilShare",
    "PerLeak",
    "Proof",
    "PutIn",
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
    "Since",
    "Slope",
    "Spell",
    "Trace",
    "TraceError",
    "TraceWarning",
    "Trend",
    "Valve",
    "Verdict",
    "Wiring",
    "__version__",
    "calibrate",
    "check",
    "diagnose",
    "explanations",
    "fleet",
    "prove",
    "replay",
    "reproduce",
    "simulate",
]
