"""What a user may hand over as a trace or a rig, made ready for the engine."""

import os
import sys
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

from . import _arguments
from ._arrow import from_arrow, from_polars
from ._collected import collected
from ._columns import nanoseconds, numbers
from ._index import with_index
from ._pitchleak import Layout, Rig, Table, TraceError

Path: TypeAlias = str | os.PathLike[str]
#: What foreign columns are, as ``[columns]`` of a rig file has it: headers with their units, or dicts, by signal.
Columns: TypeAlias = Mapping[str, str | Mapping[str, Any]]
Source: TypeAlias = str | Table


class TraceWarning(UserWarning):
    """Something about a trace that a reader of the results should know, as the program prints it."""


def warn(messages: Sequence[str], name: str = "") -> None:
    """Gives each message at the line of the user's call."""
    for message in messages:
        text = f"{name}: {message}" if name else message
        warnings.warn(text, TraceWarning, stacklevel=_depth())


def _depth() -> int:
    """How many calls lie between the caller of this and the first line outside of the package."""
    here = os.path.dirname(__file__)
    frame, depth = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(here):
        frame, depth = frame.f_back, depth + 1
    return depth


def is_path(data: Any) -> bool:
    return isinstance(data, (str, os.PathLike))


def files(rig: Rig, *sources: Source) -> list[str]:
    """The files among what a result rests on."""
    return [rig.name, *(source for source in sources if isinstance(source, str))]


def source(data: Any, rig: Rig, first_ns: int | None = None) -> Source:
    """A path as it is; columns as a table that borrows them."""
    if is_path(data):
        return str(os.fspath(data))
    data = collected(data, rig)
    if isinstance(data, Mapping) or _is_pandas(data):
        return _from_columns(data, rig, first_ns)
    if type(data).__module__.partition(".")[0] == "polars" and type(data).__name__ == "DataFrame":
        return from_polars(data, rig, first_ns)
    if _is_arrow(data):
        return from_arrow(data, rig, first_ns)
    raise TypeError(f"{type(data).__name__} is no trace: give a data frame, an Arrow table, a dict of arrays or a path")


def rig_for(data: Any, rig: Rig | Path | None, columns: Columns | None = None) -> Rig:
    """The rig given, else the one beside a file, else the built-in one; with ``columns``."""
    found = _rig_for(data, rig)
    if columns is None:
        return found
    return found.replace(columns=_arguments.entries("columns", columns, "{'pa': 'Head pressure [bar]'}"))


def _rig_for(data: Any, rig: Rig | Path | None) -> Rig:
    if isinstance(rig, Rig):
        return rig
    if isinstance(rig, (str, os.PathLike)):
        return Rig.load(rig)
    if rig is not None:
        raise TypeError(f"`rig`: {type(rig).__name__} is none; give a pitchleak.Rig or the path of a rig file")
    return Rig.beside(data) if is_path(data) else Rig.paper()


def _is_arrow(data: Any) -> bool:
    """A column alone has the interface, too, and is no table."""
    has = hasattr(data, "__arrow_c_stream__") or hasattr(data, "__arrow_c_array__")
    return has and type(data).__name__ not in ("Series", "ChunkedArray")


def _is_pandas(data: Any) -> bool:
    """Its columns are borrowed one by one: no pyarrow needed, and missing values stay NaN."""
    return type(data).__module__.partition(".")[0] == "pandas" and hasattr(data, "columns")


def _from_columns(data: Any, rig: Rig, first_ns: int | None) -> Table:
    headers = list(data.keys())
    for header in headers:
        if not isinstance(header, str):
            raise TypeError(f"column names are texts such as `t_s`; {header!r} is none")
    if len(set(headers)) < len(headers):
        double = next(header for header in headers if headers.count(header) > 1)
        raise ValueError(f"two columns are named `{double}`: keep one")
    try:
        layout = Layout(headers, rig)
    except TraceError:
        with_time = with_index(data)
        if with_time is None:
            raise
        data, headers = with_time, list(with_time)
        layout = Layout(headers, rig)
    read: dict[str, Any] = {"numbers": numbers, "timestamps": nanoseconds}
    columns = [
        read[content](header, data[header]) if content in read else None
        for header, content in zip(headers, layout.contents, strict=True)
    ]
    return Table.from_arrays(layout, [columns], first_ns)
