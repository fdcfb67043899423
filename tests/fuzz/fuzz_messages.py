"""Generates a small valid value of every message class, from the declared types and ranges of its fields."""

from __future__ import annotations

from typing import Any

import msgspec
from message_values import FITTED
from msgspec import inspect


def smallest(kind: type[Any]) -> Any:
    """Returns a message with small values, and lists of one element where one is allowed."""
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType)
    return _message(info)


def _message(info: inspect.StructType) -> Any:
    values = {field.name: _value(field.type) for field in info.fields}
    if info.cls.__name__ in FITTED:
        FITTED[info.cls.__name__](values)
    return msgspec.convert(msgspec.to_builtins(info.cls(**values), builtin_types=(bytes,)), info.cls)


def _value(info: inspect.Type) -> Any:
    match info:
        case inspect.UnionType():
            return _value(next((t for t in info.types if not isinstance(t, inspect.NoneType)), info.types[0]))
        case inspect.NoneType():
            return None
        case inspect.BoolType():
            return True
        case inspect.LiteralType():
            return info.values[0]
        case inspect.EnumType():
            return next(iter(info.cls))
        case inspect.IntType():
            return info.ge if info.ge is not None else 0
        case inspect.FloatType():
            low = info.ge if info.ge is not None else info.gt
            return 0.0 if low is None else low if info.gt is None else low + 1e-3
        case inspect.StrType():
            return "a" * max(info.min_length or 0, min(info.max_length or 3, 3))
        case inspect.BytesType():
            return bytes(info.min_length or 0)
        case inspect.ListType():
            count = max(info.min_length or 0, min(1 if info.max_length is None else info.max_length, 1))
            return [_value(info.item_type) for _ in range(count)]
        case inspect.TupleType():
            return tuple(map(_value, info.item_types))
        case inspect.StructType():
            return _message(info)
    raise AssertionError(f"a field of the type {info}: say here which value is small")
