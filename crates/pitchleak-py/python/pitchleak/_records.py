"""The engine's JSON as frozen dataclasses; what they do not name is still in ``raw``."""

import dataclasses
import types
import typing
from collections.abc import Callable, Hashable, Mapping
from functools import cache
from typing import Any, TypeAlias, TypeVar

T = TypeVar("T")

#: Makes a value of JSON what a field's type asks for; None where it is that already.
_Convert: TypeAlias = Callable[[Any], Any] | None


def record(cls: type[T], data: Mapping[str, Any]) -> T:
    """``data`` as a dataclass: unknown keys are left out, missing ones take the field's default. What would be a
    word of Python's has an underscore behind it as a field (``from_``)."""
    known = {}
    for name, convert in _fields(typing.cast(Hashable, cls)):
        key = name.removesuffix("_")
        if key in data:
            value = data[key]
            known[name] = value if convert is None or value is None else convert(value)
    return cls(**known)


@cache
def _fields(cls: Any) -> tuple[tuple[str, _Convert], ...]:
    hints = typing.get_type_hints(cls)
    return tuple((field.name, _converter(hints[field.name])) for field in dataclasses.fields(cls) if field.init)


def _converter(kind: Any) -> _Convert:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        (kind,) = [argument for argument in arguments if argument is not types.NoneType]
        return _converter(kind)
    if origin is tuple:
        return _tuple(_or_none(_converter(arguments[0])))
    if origin is dict:
        return _entries(dict, _or_none(_converter(arguments[1])))
    if dataclasses.is_dataclass(origin):  # a generic one, such as PerLeak[Leakage]
        return _entries(typing.cast(Callable[..., Any], origin), _or_none(_converter(arguments[0])))
    if dataclasses.is_dataclass(kind):
        return lambda data: record(kind, data)  # type: ignore[arg-type]
    return None


def _tuple(each: _Convert) -> _Convert:
    return tuple if each is None else lambda items: tuple(map(each, items))


def _entries(make: Callable[..., Any], each: _Convert) -> _Convert:
    if each is None:
        return lambda items: make(**items)
    return lambda items: make(**{key: each(item) for key, item in items.items()})


def _or_none(convert: _Convert) -> _Convert:
    return None if convert is None else lambda value: None if value is None else convert(value)
