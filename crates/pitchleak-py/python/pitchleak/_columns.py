"""Columns of any kind as numpy arrays, without a copy where they are plain float64 already."""

from datetime import UTC
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Nanoseconds = npt.NDArray[np.int64]

#: The one column that is either so or not.
YES_OR_NO = "shut"

_NOT_A_TIME = np.datetime64("NaT", "ns")


def numbers(name: str, values: Any) -> Floats:
    """``values`` as contiguous, aligned float64; a missing value becomes NaN."""
    array = _one_dimensional(name, _to_numpy(values))
    if isinstance(array, np.ma.MaskedArray):
        array = np.ma.filled(array.astype(np.float64), np.nan)
    if array.dtype == object:
        array = _from_objects(name, array)
    if array.dtype.kind not in ("iufb" if name == YES_OR_NO else "iuf"):
        raise TypeError(f"column `{name}` holds {array.dtype}; numbers are expected")
    return np.require(array, np.float64, ["C", "A"])


def nanoseconds(name: str, values: Any) -> Nanoseconds:
    """Times as int64 nanoseconds, the least int64 where there is none."""
    if hasattr(values, "dt") and getattr(values.dt, "tz", None) is not None:
        values = values.dt.tz_convert("UTC").dt.tz_localize(None)
    array = _one_dimensional(name, _to_numpy(values))
    if array.dtype == object:
        array = _in_utc(name, array)
    if array.dtype.kind in "OUT":
        try:
            array = array.astype("datetime64[ns]")
        except (TypeError, ValueError) as error:
            raise TypeError(f"column `{name}`: not times in ISO 8601 ({error})") from None
    if array.dtype.kind != "M":
        raise TypeError(f"column `{name}` holds {array.dtype}; times (datetime64) are expected")
    times = array.astype("datetime64[ns]")
    # numpy wraps around beyond the years 1678 to 2262.
    return np.ascontiguousarray(np.where(times.astype(array.dtype) == array, times, _NOT_A_TIME)).view(np.int64)


def _in_utc(name: str, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Times that each have a zone in UTC, where numpy would warn of each; others as they are."""
    zoned = [getattr(value, "tzinfo", None) is not None for value in array]
    if not any(zoned):
        return array
    for row, (value, has_zone) in enumerate(zip(array, zoned, strict=True)):
        if not has_zone and value == value and value is not None:
            raise ValueError(
                f"column `{name}`, row {row}: a time without a zone among times with one; give all one zone"
            )
    utc = [
        value.astimezone(UTC).replace(tzinfo=None) if has_zone else None
        for value, has_zone in zip(array, zoned, strict=True)
    ]
    return np.array(utc, object)


def _to_numpy(values: Any) -> npt.NDArray[Any]:
    dtype = getattr(values, "dtype", None)
    if hasattr(values, "to_numpy"):
        # pandas' own nullable numbers become objects unless told what a missing one is.
        if getattr(dtype, "kind", "") in "iuf" and not isinstance(dtype, np.dtype):
            return np.asarray(values.to_numpy(dtype=np.float64, na_value=np.nan))
        return np.asarray(values.to_numpy())
    return values if isinstance(values, np.ma.MaskedArray) else np.asarray(values)


def _one_dimensional(name: str, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    if array.ndim == 0:
        array = array.reshape(1)
    if array.ndim != 1:
        raise ValueError(f"column `{name}` has {array.ndim} dimensions; one is expected")
    return array


def _from_objects(name: str, array: npt.NDArray[Any]) -> Floats:
    """Python numbers and None; anything else is named with its row."""
    floats = np.empty(len(array), np.float64)
    for row, value in enumerate(array):
        if value is None:
            floats[row] = np.nan
        elif isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
            floats[row] = value
        else:
            kind = type(value).__name__
            raise TypeError(f"column `{name}`, row {row}: {kind} where a number is expected")
    return floats
