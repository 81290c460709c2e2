"""Results that are tables, for whichever library the reader works with."""

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow


def optional(module: str, extra: str) -> Any:
    """A library that comes with an extra."""
    try:
        return importlib.import_module(module)
    except ImportError:
        message = f"this needs {module.partition('.')[0]}: pip install 'pitchleak[{extra}]'"
        raise ImportError(message) from None


class Tabular:
    """A table by its columns."""

    __slots__ = ()

    @property
    def table(self) -> Mapping[str, Any]:
        """The columns: numpy arrays or lists of one length."""
        raise NotImplementedError

    def to_arrow(self) -> "pyarrow.Table":
        """The table as a :class:`pyarrow.Table`."""
        table: pyarrow.Table = optional("pyarrow", "arrow").table(dict(self.table))
        return table

    def to_pandas(self) -> "pandas.DataFrame":
        """The table as a :class:`pandas.DataFrame`."""
        frame: pandas.DataFrame = optional("pandas", "pandas").DataFrame(dict(self.table))
        return frame

    def to_polars(self) -> "polars.DataFrame":
        """The table as a :class:`polars.DataFrame`."""
        frame: polars.DataFrame = optional("polars", "polars").DataFrame(dict(self.table))
        return frame
