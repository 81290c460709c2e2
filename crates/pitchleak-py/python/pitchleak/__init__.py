"""Leak detection for hydraulic pitch cylinders.

>>> import pitchleak as pl
>>> trace = pl.simulate(wind=13, leak_external_a="0.5 L/min", duration=20)
>>> out = pl.replay(trace.columns)
>>> out.verdict.faults
('external_a',)

A trace is a pandas, polars or pyarrow table, anything else with the Arrow PyCapsule interface, a dict of
numpy arrays, or a path; its columns are named ``<signal>_<unit>`` as in trace files, for instance ``t_s``,
``x_mm``, ``pa_bar``, ``pb_bar``, ``qa_lpm``, ``qb_lpm``. Equations are those of Wu et al. (2011), doi
10.1109/TMECH.2011.2142400.
"""

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
