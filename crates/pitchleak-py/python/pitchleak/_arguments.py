"""What an argument has to be, told by its name: an error here is one line, and says what is allowed."""

import os
from collections.abc import Mapping, Sequence
from math import isnan
from numbers import Integral, Real
from typing import Any

import numpy as np

LPM_PER_M3S = 60e3
#: More than leaks in any pitch cylinder: 60 L/min.
MOST_FLOW_M3S = 1e-3


def quantity(name: str, value: Any, example: str) -> float | str:
    """A number in SI, or a text with its unit such as ``example``."""
    if isinstance(value, str):
        if _is_bare(value):
            raise ValueError(
                f"{name}: `{value}` has no unit; write it with one, such as {example!r}, or a number in SI"
            )
        return value
    return number(name, value, f"a number in SI, or a text with its unit such as {example!r}")


def flow(name: str, value: Any, example: str) -> float | str:
    """A leak's flow: as a number more than any cylinder has is L/min that were meant."""
    given = quantity(name, value, example)
    if isinstance(given, float) and given > MOST_FLOW_M3S:
        raise ValueError(
            f"{name}: {given:g} m^3/s is {given * LPM_PER_M3S:g} L/min; a number is in m^3/s and at most "
            f"{MOST_FLOW_M3S:g}: write its unit, such as '{given:g} L/min'"
        )
    return given


def number(name: str, value: Any, allowed: str = "a number") -> float:
    """A real number."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
        raise TypeError(f"{name}: {kind(value)} is none; give {allowed}")
    if isnan(value):
        raise ValueError(f"{name}: nan is no number; give {allowed}")
    return float(value)


def count(name: str, value: Any, least: int) -> int:
    """A whole number from ``least`` on."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name}: {kind(value)} is none; give a whole number")
    if value < least:
        raise ValueError(f"{name}: at least {least}")
    return int(value)


def flag(name: str, value: Any, allowed: str = "True or False") -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name}: {kind(value)} is none; give {allowed}")
    return bool(value)


def word(name: str, value: Any, allowed: str) -> str:
    """A text; what it may be is checked where it is used."""
    if not isinstance(value, str):
        raise TypeError(f"{name}: {kind(value)} is none; give {allowed}")
    return value


def words(name: str, value: Any, example: str) -> list[str]:
    """A text such as ``example``, or several of them."""
    if isinstance(value, str):
        return [value]
    if not isinstance(value, Sequence) or not all(isinstance(one, str) for one in value):
        raise TypeError(f"{name}: {kind(value)} is none; give texts such as {example!r}")
    return list(value)


def entries(name: str, value: Any, example: str) -> Mapping[Any, Any]:
    """A dict such as ``example``."""
    if not isinstance(value, Mapping):
        raise TypeError(f"{name}: {kind(value)} is none; give a dict such as {example}")
    return value


def path(name: str, value: Any) -> str:
    """A file or a folder."""
    if not isinstance(value, (str, os.PathLike)):
        raise TypeError(f"{name}: {kind(value)} is none; give a path")
    return str(os.fspath(value))


def kind(value: Any) -> str:
    """What a message calls it."""
    return type(value).__name__


def _is_bare(text: str) -> bool:
    """Whether it is a number without a unit; zero needs none."""
    try:
        return float(text) != 0.0
    except ValueError:
        return False
