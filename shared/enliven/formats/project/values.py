"""Converts a document to JSON and arrays, and back, by the type hints of its dataclasses.

A dataclass and a mapping become JSON objects, and a tuple becomes a JSON array. A NumPy array becomes
``{"array": <name>}``, and its numbers are stored separately. Equal arrays are stored once. Numbers are
restored exactly, because JSON contains the shortest decimal that is parsed to the same float64. A field that
is missing in a file gets its default, so new fields can be added without a new version. The JSON object of a
rig contains its kind.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import types
import typing
from collections.abc import Mapping
from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import RigBase
from enliven.errors import InputError

ARRAY = "array"
KIND = "kind"


class UnknownFieldError(InputError):
    """Raised for a field, a value or a kind of character that this version does not know. The file may be
    from a later version.
    """


def pack(value: Any, arrays: dict[str, AnyArray]) -> Any:
    """Converts ``value`` to JSON. Adds its arrays to ``arrays``, with a checksum of their content as key."""
    if isinstance(value, np.ndarray):
        name = array_checksum(value)
        arrays[name] = value
        return {ARRAY: name}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = [field.name for field in dataclasses.fields(value) if field.init]
        packed_fields = {name: pack(getattr(value, name), arrays) for name in fields}
        return {KIND: value.kind, **packed_fields} if isinstance(value, RigBase) else packed_fields
    if isinstance(value, Mapping):
        return {str(key): pack(inner, arrays) for key, inner in value.items()}
    if isinstance(value, (tuple, list)):
        return [pack(inner, arrays) for inner in value]
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a document cannot contain a {type(value).__name__}")


def array_checksum(array: AnyArray) -> str:
    """Returns the name of an array: a checksum of its type, shape and numbers."""
    digest = hashlib.blake2b(f"{array.dtype.str}{array.shape}".encode(), digest_size=16)
    digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def unpack(hint: Any, value: Any, arrays: Mapping[str, AnyArray], where: str) -> Any:
    """Converts JSON to a value of the type ``hint``.

    Raises:
        InputError: if the value does not match the type. ``where`` is the path to the value, for the message.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        if value is None and type(None) in arguments:
            return None
        item_hint = next(argument for argument in arguments if argument is not type(None))
        return unpack(item_hint, value, arrays, where)
    if hint is RigBase:
        return _read_rig(_check_type(value, dict, where), arrays, where)
    if origin is np.ndarray:
        name = value.get(ARRAY) if isinstance(value, dict) else None
        if not isinstance(name, str) or name not in arrays:
            raise InputError("an array is missing", where=where)
        return arrays[name]
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return _read_dataclass(hint, value, arrays, where)
    if origin is typing.Literal:
        if value not in arguments:
            raise UnknownFieldError(f"the value {value!r} is unknown", where=where)
        return value
    if origin is not None and issubclass(origin, Mapping):
        table = _check_type(value, dict, where)
        return {key: unpack(arguments[1], v, arrays, f"{where}.{key}") for key, v in table.items()}
    if origin is tuple:
        return _read_tuple(arguments, _check_type(value, list, where), arrays, where)
    if hint is Any:
        return value
    return _check_type(value, hint, where)


def _read_rig(table: Any, arrays: Mapping[str, AnyArray], where: str) -> Any:
    """Reads a character. Its JSON object contains its kind of rig."""
    kind = table.get(KIND)
    if kind not in RigBase.kinds:
        raise UnknownFieldError(f"the kind of character {kind!r} is unknown", where=where)
    fields = {name: value for name, value in table.items() if name != KIND}
    return _read_dataclass(RigBase.kinds[kind], fields, arrays, where)


def _read_dataclass(kind: type[Any], value: Any, arrays: Mapping[str, AnyArray], where: str) -> Any:
    table = _check_type(value, dict, where)
    hints = _type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}
    unknown = [key for key in table if key not in fields]
    if unknown:
        raise UnknownFieldError(f"the field {unknown[0]!r} is unknown", where=where)
    arguments = {}
    for name, field in fields.items():
        if name in table:
            arguments[name] = unpack(hints[name], table[name], arrays, f"{where}.{name}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise InputError(f"the field {name!r} is missing", where=where)
    return kind(**arguments)


@functools.cache
def _type_hints(kind: type[Any]) -> dict[str, Any]:
    """Returns the types of a dataclass's fields. The result is cached, because Python evaluates the
    annotations at each call."""
    return typing.get_type_hints(kind)


def _read_tuple(hints: tuple[Any, ...], values: list[Any], arrays: Mapping[str, AnyArray], where: str) -> Any:
    is_variadic = hints[1:] == (Ellipsis,)
    if not is_variadic and len(hints) != len(values):
        raise InputError(f"the list has {len(values)} values, expected {len(hints)}", where=where)
    item_hints = [hints[0]] * len(values) if is_variadic else list(hints)
    return tuple(
        unpack(hint, value, arrays, f"{where}[{number}]")
        for number, (hint, value) in enumerate(zip(item_hints, values, strict=True))
    )


def _check_type(value: Any, kind: Any, where: str) -> Any:
    """Returns the value after checking its plain type. An integer is accepted as a float."""
    accepted = (int, float) if kind is float else kind
    if not isinstance(value, accepted) or (isinstance(value, bool) and kind is not bool):
        name = getattr(kind, "__name__", str(kind))
        raise InputError(f"{str(value)[:40]!r} is not a {name}", where=where)
    return value
