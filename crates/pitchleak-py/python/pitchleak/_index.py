"""A pandas frame whose time is its index, not a column."""

from typing import Any

#: What libraries call an index of seconds: pandas nothing, asammdf `timestamps`, npTDMS nothing or `Time`.
_SECONDS = {None, "t", "time", "timestamps"}


def with_index(frame: Any) -> dict[str, Any] | None:
    """The columns with the index as the first: dates as ``timestamp``, spans of time as ``t_s``, numbers by their name,
    or, where that is none, as ``t_s``. None where the index only counts rows or is no time."""
    index = getattr(frame, "index", None)
    if index is None or not hasattr(frame, "columns") or getattr(index, "nlevels", 1) > 1:
        return None
    kind = getattr(index.dtype, "kind", "O")
    if kind == "M":
        times: Any = index.to_series()
        header = "timestamp"
    elif kind == "m":
        times, header = index.total_seconds(), "t_s"
    elif kind in "iuf" and (index.name is not None or type(index).__name__ != "RangeIndex"):
        name = index.name.lower() if isinstance(index.name, str) else index.name
        times, header = index, "t_s" if name in _SECONDS else str(index.name)
    else:
        return None
    if header in frame.columns:
        return None
    return {header: times} | {name: frame[name] for name in frame.columns}
