"""A table of many cylinders, taken apart by the column that names them."""

from collections.abc import Callable, Hashable, Mapping
from typing import Any

import numpy as np

from . import _arguments
from ._tabular import optional


def split(data: Any, by: str) -> dict[Hashable, Any]:
    """Parts in the order in which they first occur, without the column ``by``."""
    _arguments.word("group", by, "the name of one column")
    library = type(data).__module__.partition(".")[0]
    if library == "polars" and hasattr(data, "collect"):
        data = data.collect()
    if library == "pyarrow" and hasattr(data, "to_table"):
        data = data.to_table()
    if library == "pandas":
        _require(by, data.columns)
        groups = data.groupby(by, sort=False, dropna=False, observed=True)
        return {key: part.drop(columns=by) for key, part in groups}
    if library == "polars":
        _require(by, data.columns)
        parts = data.partition_by(by, as_dict=True, include_key=False, maintain_order=True)
        return {key: part for (key,), part in parts.items()}
    if isinstance(data, Mapping):
        _require(by, data)
        arrays = {name: np.asarray(values) for name, values in data.items()}
        keys, codes = np.unique(arrays.pop(by), return_inverse=True)
        names = list(keys) if keys.dtype.kind in "mM" else keys.tolist()
        return _split(names, codes, lambda rows: {name: values[rows] for name, values in arrays.items()})
    if hasattr(data, "__arrow_c_stream__"):
        return _split_arrow(optional("pyarrow", "arrow").table(data), by)
    raise TypeError(
        f"group: {type(data).__name__} has no groups; give a data frame, an Arrow table or a dict of arrays"
    )


def _split_arrow(table: Any, by: str) -> dict[Hashable, Any]:
    """Parts of the same types as the table; a key is what Python has for it, None for a null."""
    _require(by, table.column_names)
    keys = table[by].combine_chunks().dictionary_encode(null_encoding="encode")
    rest = table.drop_columns(by)

    def part(rows: Any) -> Any:
        return rest.slice(rows.start, rows.stop - rows.start) if isinstance(rows, slice) else rest.take(rows)

    return _split(keys.dictionary.to_pylist(), keys.indices.to_numpy(), part)


def _split(keys: list[Any], codes: Any, part: Callable[[Any], Any]) -> dict[Hashable, Any]:
    """Parts by their keys, of the rows that have the place of the key; ``part`` gets a slice or their numbers."""
    order = np.argsort(codes, kind="stable")
    ends = np.cumsum(np.bincount(codes, minlength=len(keys)))
    by_key = [order[begin:end] for begin, end in zip([0, *ends], ends, strict=False)]
    parts: dict[Hashable, Any] = {}
    for key, rows in sorted(zip(keys, by_key, strict=True), key=lambda one: one[1][0]):
        # Rows that follow each other are a view.
        together = rows[-1] - rows[0] + 1 == len(rows)
        parts[key] = part(slice(rows[0], rows[-1] + 1) if together else rows)
    return parts


def _require(by: str, columns: Any) -> None:
    if by not in columns:
        raise KeyError(f"no column `{by}` to group by; there are {', '.join(map(str, columns))}")
