"""Updates the tables of docs/settings.md from the settings classes: .venv/bin/python scripts/settings_page.py

Each setting has its own default, unit, range and description. A test checks that the page is up to date.
"""

from __future__ import annotations

import dataclasses
import math
import re
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from enliven.mapping.plan import Plan
from enliven_edge.settings import EdgeSettings
from enliven_viewer.settings import ViewerSettings
from enliven_viewer.studio.settings import StudioSettings

PAGE = Path(__file__).parents[1] / "docs" / "settings.md"
KINDS = {kind.__name__: kind for kind in (EdgeSettings, ViewerSettings, StudioSettings, Plan)}
_NAMES = {"chains": "chain"}
"""Keys with a name in a file that differs from the name in the class."""


def make_tables(kind: type, path: str = "") -> Iterator[str]:
    """Yields one TOML table for each group of settings.

    The group's own keys come first, then the nested groups.
    """
    hints, rows, groups = typing.get_type_hints(kind), list[str](), list[tuple[str, type]]()
    for field in dataclasses.fields(kind):
        if field.metadata.get("hidden"):
            continue
        inner = find_group(hints[field.name])
        key = _NAMES.get(field.name, field.name)
        if inner is None:
            rows.append(_make_row(field, hints[field.name]))
        else:
            suffix = "" if dataclasses.is_dataclass(hints[field.name]) else ".NAME" * (key != "chain")
            groups.append((f"{path}.{key}{suffix}".lstrip("."), inner))
    if rows:
        summary = (kind.__doc__ or "").partition("\n")[0]
        name = f"[[{path}]]" if path == "chain" else f"[{path}]"
        heading = [f"### `{name}`", ""] if path else []
        table = ["| key | default | may be | what it is |", "|---|---|---|---|", *rows]
        yield "\n".join([*heading, summary, "", *table])
    for name, inner in groups:
        yield from make_tables(inner, name)


def find_group(hint: Any) -> type | None:
    """Returns the class of a group, or of the groups in a table of groups, or None for a single value."""
    for kind in (hint, *typing.get_args(hint)):
        if dataclasses.is_dataclass(kind) and isinstance(kind, type):
            return kind
    return None


def _make_row(field: dataclasses.Field[Any], hint: Any) -> str:
    description = field.metadata.get("doc", "").replace("|", "\\|")
    cells = (f"`{field.name}`", _format_default(field), _format_range(field, hint), description)
    return f"| {' | '.join(cells)} |"


def _format_default(field: dataclasses.Field[Any]) -> str:
    value = field.default
    if value is dataclasses.MISSING:
        if field.default_factory is dataclasses.MISSING:
            return "required"
        value = field.default_factory()
    if value is None:
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, float):
        return f"`{value:.6g}`"
    return f"`{list(value)}`" if isinstance(value, tuple) else f"`{value!r}`".replace("'", '"')


def _format_range(field: dataclasses.Field[Any], hint: Any) -> str:
    """Returns the unit, the range, or the allowed words of a setting."""
    words = [f'`"{word}"`' for word in _list_words(hint)]
    low, high = field.metadata.get("low", -math.inf), field.metadata.get("high", math.inf)
    unit = field.metadata.get("unit", "")
    if math.isfinite(low) and math.isfinite(high):
        words.append(f"{low:g} to {high:g} {unit}".strip())
    elif math.isfinite(low):
        words.append(f"{low:g} {unit} or more".replace("  ", " "))
    elif unit:
        words.append(unit)
    return ", ".join(words)


def _list_words(hint: Any) -> Iterator[str]:
    """Yields the words of a ``Literal``, also inside a union."""
    if typing.get_origin(hint) is Literal:
        yield from map(str, typing.get_args(hint))
    elif typing.get_origin(hint) in (typing.Union, types.UnionType):
        for part in typing.get_args(hint):
            yield from _list_words(part)


def make_page(page: str) -> str:
    """Returns the page with everything between its marks regenerated."""

    def made(match: re.Match[str]) -> str:
        return "\n\n".join([f"<!-- settings {match[1]} -->", *make_tables(KINDS[match[1]]), "<!-- end -->"])

    return re.sub(r"<!-- settings (\w+) -->.*?<!-- end -->", made, page, flags=re.DOTALL)


if __name__ == "__main__":
    PAGE.write_text(make_page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
