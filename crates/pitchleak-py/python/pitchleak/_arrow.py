"""Tables in Arrow's memory as arrays of numpy, chunk by chunk: a float64 column without nulls is not copied."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ._columns import YES_OR_NO, nanoseconds, numbers
from ._pitchleak import Layout, Rig, Table
from ._tabular import optional

#: Gives the chunks of the column at a place, checked to hold ``numbers`` or ``timestamps``.
_Chunks: TypeAlias = Callable[[int, str], Sequence[npt.NDArray[Any]]]


def from_polars(frame: Any, rig: Rig, first_ns: int | None) -> Table:
    """A polars data frame; pyarrow is not needed for it."""
    polars = optional("polars", "polars")

    def chunks(place: int, content: str) -> Sequence[npt.NDArray[Any]]:
        series = frame.to_series(place)
        kind = series.dtype
        if content == "numbers":
            is_flag = kind == polars.Boolean and series.name == YES_OR_NO
            _expect(kind.is_numeric() or kind == polars.Null or is_flag, series.name, kind, content)
            series = series.cast(polars.Float64)
        else:
            _expect(kind == polars.Datetime, series.name, kind, content)
        return [chunk.to_numpy() for chunk in series.get_chunks()]

    return _table(frame.columns, chunks, rig, first_ns)


def from_arrow(data: Any, rig: Rig, first_ns: int | None) -> Table:
    """Anything with the Arrow PyCapsule interface, taken over by pyarrow."""
    arrow = optional("pyarrow", "arrow")
    try:
        table = arrow.table(data)
    except (arrow.ArrowException, TypeError, ValueError) as error:
        raise ValueError(f"no table of columns: {str(error).replace(chr(10), ' ')}") from None

    def chunks(place: int, content: str) -> Sequence[npt.NDArray[Any]]:
        name, column = table.field(place).name, table.column(place)
        kind = column.type.value_type if arrow.types.is_dictionary(column.type) else column.type
        if content == "numbers":
            are = (arrow.types.is_floating, arrow.types.is_integer, arrow.types.is_decimal, arrow.types.is_null)
            is_flag = arrow.types.is_boolean(kind) and name == YES_OR_NO
            _expect(is_flag or any(is_one(kind) for is_one in are), name, column.type, content)
            if is_flag:
                column = column.cast(arrow.uint8())
            column = column.cast(arrow.float64(), safe=False)
        else:
            _expect(arrow.types.is_timestamp(kind), name, column.type, content)
            column = column.cast(kind)
        return [chunk.to_numpy(zero_copy_only=False) for chunk in column.chunks]

    return _table(table.column_names, chunks, rig, first_ns)


def _table(headers: Sequence[str], chunks: _Chunks, rig: Rig, first_ns: int | None) -> Table:
    layout = Layout(headers, rig)
    contents = dict(enumerate(layout.contents))
    read = {place: chunks(place, content) for place, content in contents.items() if content != "ignored"}
    if len({tuple(map(len, column)) for column in read.values()}) > 1:
        # Cut at different rows.
        read = {place: [np.concatenate(column)] for place, column in read.items()}
    convert: dict[str, Any] = {"numbers": numbers, "timestamps": nanoseconds}

    def batch(index: int) -> list[Any]:
        return [
            convert[content](headers[place], read[place][index]) if place in read else None
            for place, content in contents.items()
        ]

    count = max((len(column) for column in read.values()), default=0)
    return Table.from_arrays(layout, [batch(index) for index in range(count)], first_ns)


def _expect(holds: bool, name: str, kind: Any, wanted: str) -> None:
    if not holds:
        raise TypeError(f"column `{name}` holds {kind}; {wanted} are expected")
