"""Leak detection for hydraulic pitch cylinders.

>>> import pitchleak as pl
>>> trace = pl.simulate(wind=13, leak_external_a="0.5 L/min", duration=20)
>>> out = pl.replay(trace.columns)
>>> out.verdict.faults
('external_a',)

A trace is a pandas, polars or pyarrow table, anything else with the Arrow PyCapsule interface, a dict of
numpy arrays, or a path; its columns are named ``<signal>_<unit>`` as in trace files, for instance ``t_s``,
``x_mm``, ``pa_bar``, ``pb_bar``, ``qa_lpm``, ``qb_lpm``. Equations are those of Wu et al. (2011), doi
10.1109/TMECH.2011.2142400.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._api import *  # noqa: F403
    from ._api import __all__ as __all__


def __getattr__(name: str) -> Any:
    """Imports all, and numpy with it, when the first name is asked for."""
    if not name.startswith("_") or name in ("__all__", "__version__"):
        api = import_module(f"{__name__}._api")
        globals().update({known: getattr(api, known) for known in ("__all__", *api.__all__)})
    if name in globals():
        return globals()[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__getattr__("__all__")})
