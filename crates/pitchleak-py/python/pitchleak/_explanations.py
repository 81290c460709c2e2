"""What a verdict weighs."""

from dataclasses import dataclass

from . import _pitchleak


@dataclass(frozen=True, slots=True)
class Explanation:
    """What of sensors, rig or wiring may not be as declared, or how a leak may change."""

    id: str
    """Its name, stable; ids in :attr:`Verdict.explanations` are made of these."""
    kind: str
    """Which choice it is one of: ``course``, ``zeros``, ``departure``, ``wander``, ``wiring``."""
    share: float
    """How often it is so within its kind, before any data."""
    text: str
    """In words."""
    remedy: str
    """What to do about it; empty where nothing is to be done."""
    cannot_be_told_from: tuple[str, ...]
    """Ids that no trace of the same readings tells it from."""


def explanations() -> tuple[Explanation, ...]:
    """Every explanation that a verdict weighs, as ``pitchleak explanations`` lists them.

    >>> import pitchleak as pl
    >>> [one.text for one in pl.explanations() if one.id == "flow_lag_a"]
    ['flow meter A lags']
    """
    return tuple(
        Explanation(id, kind, share, text, remedy, tuple(alike))
        for id, kind, share, text, remedy, alike in _pitchleak.explanations()
    )
