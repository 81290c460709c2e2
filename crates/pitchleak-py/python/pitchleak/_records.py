"""The engine's JSON as frozen dataclasses; what they do not name is still in ``raw``."""

import dataclasses
import types
import typing
from collections.abc import Hashable, Mapping
from functools import cache
from typing import Any, TypeVar

T = TypeVar("T")


def record(cls: type[T], data: Mapping[str, Any]) -> T:
    """``data`` as a dataclass: unknown keys are left out, missing ones take the field's default."""
    hints = _hints(cls)  # type: ignore[arg-type]
    fields = [field for field in dataclasses.fields(cls) if field.init]  # type: ignore[arg-type]
    known = {f.name: _value(hints[f.name], data[f.name]) for f in fields if f.name in data}
    return cls(**known)


@cache
def _hints(cls: Hashable) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def _value(kind: Any, data: Any) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if data is None or kind is Any:
        return data
    if origin in (typing.Union, types.UnionType):
        (kind,) = [argument for argument in arguments if argument is not types.NoneType]
        return _value(kind, data)
    if origin is tuple:
        each = arguments[0]
        return tuple(_value(each, item) for item in data)
    if origin is dict:
        return {key: _value(arguments[1], item) for key, item in data.items()}
    if dataclasses.is_dataclass(origin):  # a generic one, such as PerLeak[Leakage]
        (each,) = arguments
        return origin(**{key: _value(each, item) for key, item in data.items()})  # type: ignore[operator]
    if dataclasses.is_dataclass(kind):
        return record(kind, data)  # type: ignore[arg-type]
    return data
