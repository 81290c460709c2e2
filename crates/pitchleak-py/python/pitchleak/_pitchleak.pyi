import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Self, TypeAlias, final, overload

import numpy as np
import numpy.typing as npt
from typing_extensions import disjoint_base

_Floats: TypeAlias = npt.NDArray[np.float64]
_Path: TypeAlias = str | os.PathLike[str]
_Source: TypeAlias = _Path | Table
_Readings: TypeAlias = float | npt.ArrayLike
_Quantity: TypeAlias = float | str
_Section: TypeAlias = Mapping[str, Any]
_Columns: TypeAlias = list[tuple[str, _Floats]]
_Residuals: TypeAlias = list[tuple[str, list[float], list[float]]]

__all__ = [
    "Estimator",
    "FleetNights",
    "FleetRow",
    "Layout",
    "Linkage",
    "Rig",
    "RigError",
    "Stop",
    "Table",
    "TraceError",
    "__version__",
    "calibrate",
    "check",
    "check_page",
    "diagnose",
    "explanations",
    "fleet_json",
    "fleet_odds",
    "fleet_page",
    "fleet_row",
    "fleet_save",
    "fleet_table",
    "fleet_text",
    "fleet_traces",
    "over_time",
    "prove",
    "replay",
    "replay_page",
    "reproduce",
    "simulate",
    "write_page",
]
__version__: Final[str]

class TraceError(ValueError):
    column: str | None
    row: int | None
    line: int | None

class RigError(ValueError): ...

@final
class Rig:
    def __new__(
        cls,
        *,
        area_a: _Quantity,
        area_b: _Quantity,
        stroke: _Quantity,
        moving_mass: _Quantity,
        bulk_modulus: _Quantity,
        dead_volume_a: _Quantity = ...,
        dead_volume_b: _Quantity = ...,
        bulk_modulus_std: _Quantity = ...,
        accuracy: _Quantity = ...,
        flow: _Section = ...,
        flow_a: _Section = ...,
        flow_b: _Section = ...,
        pressure: _Section = ...,
        position: _Section = ...,
        force: _Section = ...,
        estimator: str | _Section = ...,
        alarms: _Section = ...,
        columns: _Section = ...,
        csv: _Section = ...,
        effects: _Section = ...,
        name: str = "rig",
        **sections: _Section,
    ) -> Self: ...
    def replace(
        self,
        *,
        area_a: _Quantity = ...,
        area_b: _Quantity = ...,
        stroke: _Quantity = ...,
        moving_mass: _Quantity = ...,
        bulk_modulus: _Quantity = ...,
        dead_volume_a: _Quantity = ...,
        dead_volume_b: _Quantity = ...,
        bulk_modulus_std: _Quantity = ...,
        accuracy: _Quantity = ...,
        flow: _Section | None = ...,
        flow_a: _Section | None = ...,
        flow_b: _Section | None = ...,
        pressure: _Section | None = ...,
        position: _Section | None = ...,
        force: _Section | None = ...,
        estimator: str | _Section | None = ...,
        alarms: _Section | None = ...,
        columns: _Section | None = ...,
        csv: _Section | None = ...,
        effects: _Section | None = ...,
        name: str = ...,
        **sections: _Section | None,
    ) -> Rig: ...
    @staticmethod
    def paper() -> Rig: ...
    @staticmethod
    def load(path: _Path) -> Rig: ...
    @staticmethod
    def parse(text: str, name: str = "rig") -> Rig: ...
    @staticmethod
    def beside(trace: _Path) -> Rig: ...
    def to_toml(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def area_a_m2(self) -> float: ...
    @property
    def area_b_m2(self) -> float: ...
    @property
    def stroke_m(self) -> float: ...
    @property
    def moving_mass_kg(self) -> float: ...
    @property
    def dead_volume_a_m3(self) -> float: ...
    @property
    def dead_volume_b_m3(self) -> float: ...
    @property
    def bulk_modulus_pa(self) -> float: ...
    @property
    def bulk_modulus_std_pa(self) -> float: ...
    @property
    def estimator(self) -> str: ...
    @property
    def alarm_thresholds_lpm(self) -> list[float]: ...
    @property
    def effects(self) -> dict[str, float]: ...
    def _repr_html_(self) -> str: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, tuple[str, str]]: ...

@final
class Linkage:
    def __new__(
        cls,
        *,
        pivot_distance_m: float | None = None,
        retracted_length_m: float | None = None,
        crank_radius_m: float | None = None,
        zero_angle_rad: float | None = None,
    ) -> Self: ...
    @overload
    def position_m(self, pitch_rad: float) -> float: ...
    @overload
    def position_m(self, pitch_rad: _Floats) -> _Floats: ...
    @overload
    def pitch_rad(self, position_m: float) -> float: ...
    @overload
    def pitch_rad(self, position_m: _Floats) -> _Floats: ...
    @overload
    def arm_m(self, pitch_rad: float) -> float: ...
    @overload
    def arm_m(self, pitch_rad: _Floats) -> _Floats: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, float]]: ...
    def torque_nm(self, pitch_rad: float, force_n: float) -> float: ...
    def force_n(self, pitch_rad: float, torque_nm: float) -> float: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...

@final
class Layout:
    def __new__(cls, headers: Sequence[str], rig: Rig) -> Self: ...
    @property
    def contents(self) -> list[str]: ...
    def __reduce__(self) -> tuple[type[Layout], tuple[list[str], Rig]]: ...

@final
class Table:
    @staticmethod
    def from_arrays(
        layout: Layout,
        batches: Sequence[Sequence[_Floats | npt.NDArray[np.int64] | None]],
        first_ns: int | None = None,
    ) -> Table: ...
    @property
    def first_ns(self) -> int | None: ...
    @property
    def batches(self) -> list[list[_Floats | None]]: ...
    def __reduce__(self) -> tuple[Any, tuple[Layout, list[list[_Floats | None]], int | None]]: ...

@final
class Stop:
    def __new__(cls) -> Self: ...
    def set(self) -> None: ...

@final
class FleetNights:
    def __new__(cls, folder: _Path) -> Self: ...
    def new_as(self, trace: _Path, rig: Rig | None) -> str | None: ...
    def add(self, seen: Sequence[str], rows: Sequence[FleetRow]) -> list[FleetRow]: ...

@final
class FleetRow:
    @staticmethod
    def failed(cylinder: str, begins: str | None, path: str, error: str) -> FleetRow: ...
    @staticmethod
    def from_bytes(bytes: bytes) -> FleetRow: ...
    @property
    def error(self) -> str | None: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, tuple[bytes]]: ...

@disjoint_base
class Estimator:
    def __new__(cls, rig: Rig, *, estimator: str | None = None, strict: bool = False) -> Self: ...
    def update(
        self,
        t: _Readings,
        x: _Readings,
        pa: _Readings,
        pb: _Readings,
        qa: _Readings | None = None,
        qb: _Readings | None = None,
        *,
        force: _Readings | None = None,
        v: _Readings | None = None,
        temp: _Readings | None = None,
    ) -> int: ...
    def saved(self) -> bytes: ...
    def save(self, path: _Path) -> None: ...
    def restore(self, saved: bytes) -> None: ...
    @staticmethod
    def saved_rig(saved: bytes) -> Rig: ...
    @property
    def epoch_ns(self) -> int | None: ...
    def extend_source(self, source: _Source) -> int: ...
    def report(self) -> tuple[str, str] | None: ...
    @property
    def time_s(self) -> float | None: ...
    @property
    def rig(self) -> Rig: ...
    @property
    def strict(self) -> bool: ...

def replay(
    source: _Source, rig: Rig, estimator: str | None, strict: bool, stop: Stop | None = None
) -> tuple[str, str]: ...
def over_time(source: _Source, rig: Rig, estimator: str | None, strict: bool) -> tuple[str, _Columns]: ...
def check(source: _Source, rig: Rig, strict: bool) -> tuple[str, str]: ...
def calibrate(
    traces: Sequence[_Source], rig: Rig, leaks: str, evidence: _Source | None
) -> tuple[str, str, list[str]]: ...
def prove(source: _Source, rig: Rig, strict: bool, sizes: Sequence[Sequence[float | str]]) -> tuple[str, str, str]: ...
def explanations() -> list[tuple[str, str, float, str, str, list[str]]]: ...
def replay_page(source: _Source, rig: Rig, estimator: str | None, strict: bool) -> tuple[str, str]: ...
def check_page(source: _Source, rig: Rig, strict: bool) -> tuple[str, str]: ...
def write_page(path: _Path, html: str, inputs: Sequence[_Path]) -> None: ...
def diagnose(
    train: Sequence[_Source],
    test: Sequence[_Source],
    rig: Rig,
    strict: bool,
    progress: Callable[[float, float], Any] | None = None,
) -> tuple[str, str, str, Rig, _Residuals, _Residuals, list[str]]: ...
def simulate(
    order: Mapping[str, Any], rig: Rig, out: _Path | None, progress: Callable[[float, float], Any] | None = None
) -> tuple[str, list[str], _Columns]: ...
def reproduce(
    seeds: int, out: _Path | None, progress: Callable[[float, float], Any] | None = None
) -> tuple[str, str, str]: ...
def fleet_traces(
    patterns: Sequence[str], rigs: _Path | None
) -> tuple[list[tuple[str, str, str | None, str | None]], list[str]]: ...
def fleet_row(source: _Source, cylinder: str, begins: str | None, rig: Rig, stop: Stop | None = None) -> FleetRow: ...
def fleet_table(rows: Sequence[FleetRow]) -> list[tuple[str, str, Any]]: ...
def fleet_json(rows: Sequence[FleetRow]) -> str: ...
def fleet_odds(rows: Sequence[FleetRow]) -> tuple[str, str | None]: ...
def fleet_page(rows: Sequence[FleetRow]) -> str: ...
def fleet_text(rows: Sequence[FleetRow]) -> str: ...
def fleet_save(rows: Sequence[FleetRow], path: _Path) -> None: ...
