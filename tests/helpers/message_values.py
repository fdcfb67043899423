"""Generates values inside and outside the declared ranges of messages, from the types of their fields."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
from hypothesis import strategies as st
from msgspec import inspect

LONG = 200
"""Maximum length of generated texts, bytes and lists: long enough to vary, short enough to be quick."""


def fields_of(kind: type[Any]) -> list[inspect.Field]:
    """Returns the fields of a message class, with their types and ranges."""
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType)
    return list(info.fields)


def valid_values(info: inspect.Type) -> st.SearchStrategy[Any]:
    """Returns a strategy for values that a field's declaration allows, as MessagePack stores them."""
    match info:
        case inspect.UnionType():
            return st.one_of([valid_values(each) for each in info.types])
        case inspect.NoneType():
            return st.none()
        case inspect.BoolType():
            return st.booleans()
        case inspect.LiteralType():
            return st.sampled_from(list(info.values))
        case inspect.EnumType():
            return st.sampled_from(list(info.cls))
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
            return lengths.flatmap(lambda n: st.lists(valid_values(info.item_type), min_size=n, max_size=n))
        case inspect.TupleType():
            return st.tuples(*map(valid_values, info.item_types))
        case inspect.StructType():
            return message(info)
    raise AssertionError(f"a field of the type {info}: say here how its values are made")


def message(info: inspect.StructType) -> st.SearchStrategy[Any]:
    """Returns a strategy for messages of a class with all fields in range, and with consistent lengths."""
    parts = {field.name: valid_values(field.type) for field in info.fields}

    def build(values: dict[str, Any]) -> Any:
        if info.cls.__name__ in FITTED:
            FITTED[info.cls.__name__](values)
        return info.cls(**values)

    return st.fixed_dictionaries(parts).map(build)


def _fit_body(v: dict[str, Any]) -> None:
    v["orientations"] = bytes(80) if len(v["orientations"]) % 2 else b""
    v["contacts"] = b"" if len(v["contacts"]) < 2 else v["contacts"]


def _fit_cues(v: dict[str, Any]) -> None:
    v["nodes"] = bytes(2 * len(v["strengths"]))
    v["owners"] = bytes(len(v["strengths"])) if v["performers"] else b""


def _fit_props(v: dict[str, Any]) -> None:
    count = len(v["shapes"])
    for name, each in (("ids", 2), ("sizes", 6), ("colours", 3), ("positions", 6), ("turns", 4)):
        v[name] = bytes(each * count)


def _fit_match(v: dict[str, Any]) -> None:
    v["sizes"] = bytes(size % 16 for size in v["sizes"])
    v["points"] = bytes(6 * sum(v["sizes"]))
    v["limbs"] = bytes(len(v["sizes"])) if v["limbs"] else b""


def _fit_matches(v: dict[str, Any]) -> None:
    v["shown"] = min(v["shown"], len(v["matches"]) - 1)


def _fit_camera(v: dict[str, Any]) -> None:
    v["nearness"] = bytes(v["width"] * v["height"])


def _fit_scan(v: dict[str, Any]) -> None:
    for name, length in (("ends", 15), ("joints", 60), ("stage_from_camera", 12), ("view", 6)):
        v[name] = v[name] if len(v[name]) == length else []


def _fit_voice(v: dict[str, Any]) -> None:
    count = min(len(v["phrases"]), len(v["actions"]))
    v["phrases"], v["actions"] = v["phrases"][:count], v["actions"][:count]


def _fit_piece(v: dict[str, Any]) -> None:
    count = len(v["seen"])
    v["vertices"], v["colours"] = bytes(6 * count), bytes(3 * count) if v["colours"] else b""
    v["faces"] = bytes(6 * count)


def _fit_order(v: dict[str, Any]) -> None:
    v["within"] = (v["within"] or 1.0) if v["mode"] == "near" else None
    for flag in ("moved", "turned", "person"):
        v[flag] = v[flag] and v["mode"] == flag
    whole = len(v["box"]) == 6 and len(v["stage_from_scan"]) == 12
    corners = v["box"][:3], v["box"][3:]
    v["box"] = [*map(min, *corners), *map(max, *corners)] if whole else []
    v["stage_from_scan"] = v["stage_from_scan"] if whole else []


def _fit_materials(v: dict[str, Any]) -> None:
    v["of"], v["uvs"] = bytes(4 * 3), bytes(24 * 3 * v["sets"])
    v["tints"] = None if v["tints"] is None else bytes(48 * 3)


def _fit_character(v: dict[str, Any]) -> None:
    v |= {"vertex_count": 5, "face_count": 3, "pivot_count": 2, "edge_count": 1, "vertices": bytes(60)}
    v |= {
        "faces": bytes(36),
        "indices": bytes(40),
        "weights": bytes(80),
        "pivots": bytes(24),
        "edges": bytes(8),
    }
    for name, length in (("colours", 15), ("held", 4), ("pulls", 4), ("stiffness", 20)):
        v[name] = None if v[name] is None else bytes(length)


FITTED: dict[str, Callable[[dict[str, Any]], None]] = {
    "PackedBody": _fit_body,
    "CuesMessage": _fit_cues,
    "PropsMessage": _fit_props,
    "PackedMatch": _fit_match,
    "MatchesMessage": _fit_matches,
    "CameraMessage": _fit_camera,
    "VoiceMessage": _fit_voice,
    "ScanMessage": _fit_scan,
    "ScanPieceMessage": _fit_piece,
    "Scan": _fit_order,
    "MaterialsMessage": _fit_materials,
    "CharacterMessage": _fit_character,
}
"""By class, a function that makes lengths consistent. Classes without such rules need none."""


def invalid_values(info: inspect.Type) -> Iterator[Any]:
    """Yields values of the correct type, just and far outside a field's declared range."""
    match info:
        case inspect.UnionType():
            for each in info.types:
                yield from invalid_values(each)
        case inspect.IntType():
            assert info.ge is not None and info.le is not None, "a whole number needs both bounds"
            far = (info.ge - 1, info.le + 1, -(2**63), 2**64 - 1)
            yield from (n for n in far if not info.ge <= n <= info.le and -(2**63) <= n < 2**64)
        case inspect.FloatType():
            low = info.ge if info.ge is not None else info.gt
            assert low is not None and info.le is not None, "a number needs both bounds, or NaN passes"
            yield from (math.nan, math.inf, -math.inf, math.nextafter(low, -math.inf), low - 1.0)
            yield from (math.nextafter(info.le, math.inf), info.le * 2 + 1)
            if info.gt is not None:
                yield info.gt
        case inspect.StrType() | inspect.BytesType():
            empty = "" if isinstance(info, inspect.StrType) else b""
            if info.max_length is None:
                assert isinstance(info, inspect.BytesType), "text needs a longest length"
                return  # the counts in the message determine its length
            yield (empty + "x" if isinstance(empty, str) else b"x") * (info.max_length + 1)
            if info.min_length:
                yield empty
        case inspect.ListType():
            assert info.max_length is not None or info.min_length is None, "a list needs a longest length"
            for value in invalid_values(info.item_type):
                yield [value] * max(info.min_length or 0, 1)
        case inspect.TupleType():
            for value in invalid_values(info.item_types[0]):
                yield [value] * len(info.item_types)
        case inspect.LiteralType() | inspect.EnumType():
            yield "no such word"


def reachable_messages(
    kinds: list[type[Any]], seen: dict[str, type[Any]] | None = None
) -> dict[str, type[Any]]:
    """Returns all message classes reachable from the given ones, by name."""
    seen = {} if seen is None else seen
    for kind in kinds:
        if kind.__name__ in seen:
            continue
        seen[kind.__name__] = kind
        for field in fields_of(kind):
            _collect_nested(field.type, lambda inner: reachable_messages([inner], seen))
    return seen


def _collect_nested(info: inspect.Type, found: Callable[[type[Any]], Any]) -> None:
    match info:
        case inspect.StructType():
            found(info.cls)
        case inspect.UnionType():
            for each in info.types:
                _collect_nested(each, found)
        case inspect.ListType():
            _collect_nested(info.item_type, found)


def encode_unchecked(example: Any, **changes: Any) -> bytes:
    """Returns the bytes of a message with some fields replaced, without validation."""
    values = {name: getattr(example, name) for name in example.__struct_fields__} | changes
    config = example.__struct_config__
    if config.array_like:
        return msgspec.msgpack.encode(list(values.values()))
    tag = {config.tag_field: config.tag} if config.tag is not None else {}
    return msgspec.msgpack.encode({**tag, **values})
