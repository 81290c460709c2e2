"""A table of many cylinders, taken apart by the column that names them."""

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np

from ._tabular import optional


def split(data: Any, by: str) -> dict[Hashable, Any]:
    """Parts in the order in which they first occur, without the column ``by``."""
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
        return _split_arrays(data, by)
    if hasattr(data, "__arrow_c_stream__"):
        table = optional("pyarrow", "arrow").table(data)
        return _split_arrays({name: table[name].to_numpy() for name in table.column_names}, by)
    raise TypeError(f"{type(data).__name__} has no groups: give a data frame, an Arrow table or a dict of arrays")


def _split_arrays(data: Mapping[str, Any], by: str) -> dict[Hashable, Any]:
    _require(by, data)
    keys, firsts, places = np.unique(np.asarray(data[by]), return_index=True, return_inverse=True)
    rest = {name: np.asarray(values) for name, values in data.items() if name != by}
    names = keys.tolist()
    parts: dict[Hashable, Any] = {}
    for group in np.argsort(firsts):
        rows = np.flatnonzero(places == group)
        # Rows that follow each other are a view.
        together = len(rows) > 0 and rows[-1] - rows[0] + 1 == len(rows)
        pick: Any = slice(rows[0], rows[-1] + 1) if together else rows
        parts[names[group]] = {name: values[pick] for name, values in rest.items()}
    return parts


def _require(by: str, columns: Any) -> None:
    if by not in columns:
        raise KeyError(f"no column `{by}` to group by; there are {', '.join(map(str, columns))}")
