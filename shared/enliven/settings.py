"""Typed settings: every user-facing number has a default, a unit, a range and a one-sentence description.

A group of settings is a frozen dataclass with fields created by :func:`setting`. A field created by
:func:`group` contains a nested group. TOML files override the defaults. An unknown key is an error. Its
message contains the most similar known key. A key that existed in an earlier version is ignored with a
warning. Values that no user has a reason to change are constants. :func:`parameter` and :func:`data_field`
describe values that are not settings.
"""

from __future__ import annotations

import dataclasses
import difflib
import logging
import math
import tomllib
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from enliven.errors import EnlivenError, InputError, LaterVersionError, refuse_later_version
from enliven.files import is_file, read_file

log = logging.getLogger(__name__)

T = TypeVar("T")

TOML_VERSION = 1
"""Newest version of the file formats of settings, sessions, plans, spaces and calibrations. A missing key
gets its default. So a new version is only needed if the meaning of an existing key changes."""
_VERSION = "version"
"""Key of a TOML file's version."""
MAX_TOML_BYTES = 1 << 22
"""Maximum size of a TOML file in bytes. A session of 1,000 key poses with 20 points each has 1.5 million."""
MAX_LINE_BYTES = 1 << 14
"""Maximum size of a line in bytes. It is limited, because the time to parse a key with many dots is quadratic
in their number."""
MAX_NESTING = 32
"""Maximum nesting depth of tables and arrays. Files written by enliven have a depth of at most six."""
_UNKNOWN_KEY_ADVICE = "If a later version of enliven wrote the file, update enliven."
"""Advice that is appended to the error about an unknown key."""
_TOO_DEEP_REASON = f"tables or arrays are nested in more than {MAX_NESTING} levels"


def setting(
    default: Any = dataclasses.MISSING,
    doc: str = "",
    *,
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    formerly: str = "",
) -> Any:
    """Returns a dataclass field with the description, the unit and the closed range for users.

    ``formerly`` is an earlier name of the key, which old files may contain. Without a default, the key is
    required.
    """
    metadata = {"doc": doc, "unit": unit, "low": low, "high": high, "formerly": formerly}
    return dataclasses.field(default=default, metadata=metadata)


def group(kind: type, doc: str = "") -> Any:
    """Returns a dataclass field for a nested settings class. Its default is an instance of this class with
    all defaults."""
    return dataclasses.field(default_factory=kind, metadata={"doc": doc})


def data_field(
    default: Any = dataclasses.MISSING,
    doc: str = "",
    *,
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
) -> Any:
    """Returns a dataclass field for data of a document or device, with the arguments of :func:`setting`.

    Examples are the key poses of a session, the chains of a mapping, and the calibration of a camera. These
    values are stored in files, and checked like settings when they are read.
    """
    return setting(default, doc, unit=unit, low=low, high=high)


def parameter(
    default: Any, doc: str, *, unit: str = "", low: float = -math.inf, high: float = math.inf
) -> Any:
    """Returns a dataclass field for code and tests, with the arguments of :func:`setting`.

    Users cannot change it: if a settings file contains it, there is a warning. Only files that enliven wrote
    itself, such as takes, may contain it.
    """
    field = setting(default, doc, unit=unit, low=low, high=high)
    return dataclasses.field(default=default, metadata={**field.metadata, "hidden": True})


def load_settings(
    kind: type[T], source: Path | Mapping[str, Any], *, where: str = "", own_file: bool = False
) -> T:
    """Builds an instance of ``kind`` from a TOML file or a mapping, and checks each key.

    Keys in ``kind.REMOVED_SETTINGS``, and those of a :func:`parameter`, are ignored with one warning.

    Args:
        own_file: True if enliven wrote the values itself. Then fields created by :func:`parameter` are also
            read.

    Raises:
        InputError: if the file cannot be read, a key is unknown or missing, or a value has the wrong type or
            is out of range. The message contains the key's path.
    """
    if isinstance(source, Path):
        where = where or str(source)
        source = read_toml(source)
    where = where or "settings"
    removed: list[str] = []
    values = _remove_old_settings(kind, source, own_file, removed)
    if removed and not own_file:
        log.warning(
            "%s: these settings no longer exist and are ignored: %s. Delete them from the file.",
            where,
            ", ".join(removed),
        )
    return _build(kind, values, where, "")


def read_toml(path: Path, newest: int = TOML_VERSION) -> dict[str, Any]:
    """Returns the tables of a TOML file, without its format version.

    A file may start with ``version = 1``, which is also the default.

    Args:
        newest: the newest supported version of the format.

    Raises:
        InputError: if the file cannot be read, is not TOML, has a later version, is longer than
            :data:`MAX_TOML_BYTES` bytes, or is nested deeper than :data:`MAX_NESTING`.
    """
    data = read_file(path, MAX_TOML_BYTES)
    longest = max(map(len, data.splitlines()), default=0)
    try:
        if longest > MAX_LINE_BYTES:
            raise ValueError(f"a line has {longest} bytes, but at most {MAX_LINE_BYTES} are allowed")
        tables = tomllib.loads(data.decode("utf-8"))
        level: list[Any] = [tables]
        for _ in range(MAX_NESTING):
            level = [inner for container in level for inner in _list_nested_containers(container)]
        if level:
            raise ValueError(_TOO_DEEP_REASON)
    except RecursionError:
        raise InputError(f"the file is not valid TOML ({_TOO_DEEP_REASON})", where=str(path)) from None
    except ValueError as error:
        raise InputError(f"the file is not valid TOML ({error})", where=str(path)) from None
    version = tables.pop(_VERSION, 1)
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        problem, remedy = (
            f"the format version is {version!r:.40}, expected a whole number of at least 1",
            f"Write this line at the start of the file: version = {newest}",
        )
        raise InputError(problem, where=str(path), remedy=remedy)
    refuse_later_version(version, newest, str(path))
    return tables


def refuse_later_toml(path: Path) -> None:
    """Raises LaterVersionError if a TOML file has a later version, so that it is not overwritten."""
    if not is_file(path):
        return
    try:
        read_toml(path)
    except LaterVersionError:
        raise
    except EnlivenError:
        # The file is damaged or has another format. The writer reports an error if it cannot be replaced.
        return


def _list_nested_containers(value: Any) -> list[Any]:
    """Returns the tables and arrays directly inside a table or an array."""
    inner = value.values() if isinstance(value, dict) else value
    return [item for item in inner if isinstance(item, (dict, list))]


def _remove_old_settings(
    kind: type, values: Mapping[str, Any], own_file: bool, removed: list[str], prefix: str = ""
) -> dict[str, Any]:
    """Returns the values without keys that no longer exist or that users cannot change, also in nested
    groups.

    Args:
        own_file: the argument of :func:`load_settings`.
        removed: list to which the paths of these keys are appended.
        prefix: the dotted path of the group.
    """
    hints, names = typing.get_type_hints(kind), set(getattr(kind, "REMOVED_SETTINGS", ()))
    fields = {field.name: field for field in dataclasses.fields(kind)}
    kept_settings: dict[str, Any] = {}
    for key, value in values.items():
        is_hidden = key in fields and fields[key].metadata.get("hidden", False)
        if key in names or (is_hidden and not own_file):
            removed.append(prefix + key)
        elif key in fields and dataclasses.is_dataclass(hints[key]) and isinstance(value, Mapping):
            kept_settings[key] = _remove_old_settings(hints[key], value, own_file, removed, f"{prefix}{key}.")
        else:
            kept_settings[key] = value
    return kept_settings


def _build(kind: type[T], values: Mapping[str, Any], where: str, prefix: str) -> T:
    """Builds one settings group from a mapping. ``prefix`` is the dotted path of the group."""
    fields = {f.name: f for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    hints = typing.get_type_hints(kind)
    values = _apply_renames(values, {f.metadata.get("formerly", ""): name for name, f in fields.items()})
    for key in values:
        if key not in fields:
            near = difflib.get_close_matches(key, fields, n=1)
            remedy = (
                f"Did you mean {prefix}{near[0]}?"
                if near
                else f"Known keys: {', '.join(fields)}. {_UNKNOWN_KEY_ADVICE}"
            )
            raise InputError(f"unknown key {prefix}{key}", where=where, remedy=remedy)
    arguments: dict[str, Any] = {}
    for name, field in fields.items():
        if name in values:
            arguments[name] = _check_value(hints[name], values[name], where, prefix + name, field)
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise InputError(
                f"the key {prefix}{name} is missing", where=where, remedy=field.metadata.get("doc", "")
            )
    return kind(**arguments)


def _apply_renames(values: Mapping[str, Any], names: Mapping[str, str]) -> Mapping[str, Any]:
    """Returns the values with earlier names of keys replaced by the current names. If a file contains both
    names, the current name has priority."""
    old = {key: names[key] for key in values if key and key in names}
    if not old:
        return values
    return {names[k]: values[k] for k in old} | {k: v for k, v in values.items() if k not in old}


def _check_value(hint: Any, value: Any, where: str, path: str, field: dataclasses.Field[Any]) -> Any:
    """Checks a value against its type hint and range, and returns the converted value."""
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        if not isinstance(value, Mapping):
            raise InputError(f"{path} must be a table", where=where)
        return _build(hint, value, where, path + ".")
    tables = typing.get_args(hint)[1:]
    if typing.get_origin(hint) is dict and tables and dataclasses.is_dataclass(tables[0]):
        if not isinstance(value, Mapping):
            raise InputError(f"{path} must contain tables", where=where)
        group: Any = tables[0]
        return {
            key: _build_named_groups(group, table, where, f"{path}.{key}") for key, table in value.items()
        }
    converted = _convert_value(hint, value)
    if converted is _INVALID:
        expected = getattr(hint, "__name__", str(hint))
        if typing.get_origin(hint) is typing.Literal:
            expected = " or ".join(repr(word) for word in typing.get_args(hint))
        elif typing.get_origin(hint) is tuple:
            expected = "a list in square brackets"
        raise InputError(
            f"{path} is {value!r}, expected {expected}", where=where, remedy=field.metadata.get("doc", "")
        )
    low, high = field.metadata.get("low", -math.inf), field.metadata.get("high", math.inf)
    if isinstance(converted, int | float) and not low <= converted <= high:
        unit = field.metadata.get("unit", "")
        raise InputError(
            f"{path} is {converted}, outside the range {low}..{high} {unit}".rstrip(), where=where
        )
    return converted


def _build_named_groups(kind: Any, table: Any, where: str, path: str) -> Any:
    """Builds settings groups from a table with freely chosen names as keys."""
    if not isinstance(table, Mapping):
        raise InputError(f"{path} must be a table", where=where)
    return _build(kind, table, where, path + ".")


_INVALID = object()


def _convert_value(hint: Any, value: Any) -> Any:
    """Converts ``value`` to the type ``hint`` (bool, int, float, str, Literal, tuple, dict, X | None).
    Returns _WRONG if this is impossible."""
    import msgspec

    try:
        converted = msgspec.convert(value, hint)
    except msgspec.ValidationError:
        return _INVALID
    return converted if _is_finite(converted) else _INVALID


def _is_finite(value: Any) -> bool:
    """Returns True if a value, including nested tuples and tables, contains no NaN or infinity."""
    if isinstance(value, float):
        return math.isfinite(value)
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else ()
    return all(_is_finite(item) for item in inner)
