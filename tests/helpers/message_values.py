"""Values in and out of the declared ranges of messages, derived from the types of their fields."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
from hypothesis import strategies as st
from msgspec import inspect

LONG = 200
"""Longest text, bytes or list that is generated: enough to differ, short enough to be quick."""


def fields_of(kind: type[Any]) -> list[inspect.Field]:
    """The fields of a message class, with their types and ranges."""
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType)
    return list(info.fields)


def accepted(info: inspect.Type) -> st.SearchStrategy[Any]:
    """Values that a field's declaration allows, as MessagePack holds them."""
    match info:
        case inspect.UnionType():
            return st.one_of([accepted(each) for each in info.types])
        case inspect.NoneType():
            return st.none()
        case inspect.BoolType():
            return st.booleans()
        case inspect.LiteralType():
            return st.sampled_from(list(info.values))
        case inspect.IntType():
            return st.integers(info.ge, info.le)
        case inspect.FloatType():
            low, high = info.ge if info.ge is not None else info.gt, info.le
            return st.floats(low, high, exclude_min=info.gt is not None, allow_nan=False)
        case inspect.StrType():
            least = info.min_length or 0
            return st.text(min_size=least, max_size=max(least, min(info.max_length or LONG, 20)))
        case inspect.BytesType():
            least = info.min_length or 0
            return st.binary(min_size=least, max_size=max(least, min(info.max_length or LONG, LONG)))
        case inspect.ListType():
            least = info.min_length or 0
            most = max(least, min(info.max_length or 4, 60))
            lengths = st.sampled_from(sorted({least, min(least + 3, most), most}))
            return lengths.flatmap(lambda n: st.lists(accepted(info.item_type), min_size=n, max_size=n))
        case inspect.TupleType():
            return st.tuples(*map(accepted, info.item_types))
        case inspect.StructType():
            return message(info)
    raise AssertionError(f"a field of the type {info}: say here how its values are made")


def message(info: inspect.StructType) -> st.SearchStrategy[Any]:
    """Messages of a class with every field in its range; those that contradict themselves are left out."""

    def build(values: dict[str, Any]) -> Any:
        try:
            return info.cls(**values)
        except ValueError:
            return None

    parts = {field.name: accepted(field.type) for field in info.fields}
    return st.fixed_dictionaries(parts).map(build).filter(lambda made: made is not None)


def outside(info: inspect.Type) -> Iterator[Any]:
    """Values of the right type, just and far outside a field's declared range."""
    match info:
        case inspect.UnionType():
            for each in info.types:
                yield from outside(each)
        case inspect.IntType():
            assert info.ge is not None and info.le is not None, "a whole number needs both bounds"
            yield from (
                info.ge - 1,
                info.le + 1,
                *(n for n in (-(2**63), 2**64 - 1) if not info.ge <= n <= info.le),
            )
        case inspect.FloatType():
            low = info.ge if info.ge is not None else info.gt
            assert low is not None and info.le is not None, "a number needs both bounds, or NaN passes"
            yield from (math.nan, math.inf, -math.inf, math.nextafter(low, -math.inf), low - 1.0)
            yield from (math.nextafter(info.le, math.inf), info.le * 2 + 1)
            if info.gt is not None:
                yield info.gt
        case inspect.StrType() | inspect.BytesType():
            empty = "" if isinstance(info, inspect.StrType) else b""
            assert info.max_length is not None, "text and bytes need a longest length"
            yield (empty + "x" if isinstance(empty, str) else b"x") * (info.max_length + 1)
            if info.min_length:
                yield empty
        case inspect.ListType():
            assert info.max_length is not None or info.min_length is None, "a list needs a longest length"
            for value in outside(info.item_type):
                yield [value] * max(info.min_length or 0, 1)
        case inspect.TupleType():
            for value in outside(info.item_types[0]):
                yield [value] * len(info.item_types)
        case inspect.LiteralType():
            yield "no such word"


def nested(kinds: list[type[Any]], seen: dict[str, type[Any]] | None = None) -> dict[str, type[Any]]:
    """All message classes that are reached from some, by name."""
    seen = {} if seen is None else seen
    for kind in kinds:
        if kind.__name__ in seen:
            continue
        seen[kind.__name__] = kind
        for field in fields_of(kind):
            _walk(field.type, lambda inner: nested([inner], seen))
    return seen


def _walk(info: inspect.Type, found: Callable[[type[Any]], Any]) -> None:
    match info:
        case inspect.StructType():
            found(info.cls)
        case inspect.UnionType():
            for each in info.types:
                _walk(each, found)
        case inspect.ListType():
            _walk(info.item_type, found)


def unchecked(example: Any, **changes: Any) -> bytes:
    """The bytes of a message with other values in some fields, which nobody has checked."""
    values = {name: getattr(example, name) for name in example.__struct_fields__} | changes
    config = example.__struct_config__
    if config.array_like:
        return msgspec.msgpack.encode(list(values.values()))
    tag = {config.tag_field: config.tag} if config.tag is not None else {}
    return msgspec.msgpack.encode({**tag, **values})
