"""Tables that are not in memory yet: a polars LazyFrame, a pyarrow Dataset, a duckdb relation.

They are collected, with the columns that a trace is read from and no others.
"""

from collections.abc import Iterable
from typing import Any

from ._pitchleak import Layout, Rig


def collected(data: Any, rig: Rig) -> Any:
    """The same in memory; what is in memory already as it is."""
    library, kind = type(data).__module__.partition(".")[0], type(data).__name__
    if library == "polars" and kind == "LazyFrame":
        return data.select(_read(data.collect_schema().names(), rig)).collect()
    if library in ("pyarrow", "_pyarrow") and hasattr(data, "to_table") and hasattr(data, "scanner"):
        return data.to_table(columns=_read(data.schema.names, rig))
    if library in ("duckdb", "_duckdb") and kind == "DuckDBPyRelation":
        names = _read(data.columns, rig)
        return data.select(*('"' + name.replace('"', '""') + '"' for name in names)).to_arrow_table()
    return data


def _read(headers: Iterable[str], rig: Rig) -> list[str]:
    """The headers that a signal is read from; raises TraceError as the whole table would."""
    headers = list(headers)
    contents = Layout(headers, rig).contents
    return [header for header, content in zip(headers, contents, strict=True) if content != "ignored"]
