"""Reads the tables of a session's TOML file, with type checks and error locations."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from enliven.errors import InputError
from enliven.settings import load_settings, read_toml

T = TypeVar("T")
P = ParamSpec("P")

_TABLE_NAMES = ("mesh", "take", "puppet", "symmetry", "settings", "point", "pose", "layer", "root")


class SessionFile:
    """A reader of a session's TOML file, table by table.

    Raises:
        InputError: if the file cannot be read, or a table is unknown. The message names the most similar
            known table.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._found: Mapping[str, Any] = read_toml(path)
        for name in self._found:
            if name not in _TABLE_NAMES:
                similar_names = difflib.get_close_matches(name, _TABLE_NAMES, n=1)
                remedy = (
                    f"Did you mean {similar_names[0]}?"
                    if similar_names
                    else f"Known tables: {', '.join(_TABLE_NAMES)}."
                )
                raise InputError(f"unknown table {name}", where=str(path), remedy=remedy)
        if "mesh" not in self._found:
            raise InputError(
                "the session file has no table [mesh]",
                where=str(path),
                remedy='Add [mesh] with file = "PATH".',
            )

    def has_table(self, name: str) -> bool:
        """Returns True if the file has a table of that name."""
        return name in self._found

    def read_table(self, name: str, kind: type[T]) -> T:
        """Returns a table that may occur at most once. If it is missing, returns its default values."""
        value = self._found.get(name, {})
        if not isinstance(value, Mapping):
            remedy = f"Write exactly one table [{name}]."
            raise InputError(f"[{name}] must be a single table", where=str(self._path), remedy=remedy)
        return self.parse_table(f"[{name}]", kind, value)

    def read_tables(self, name: str) -> list[tuple[str, Mapping[str, Any]]]:
        """Returns tables that may occur several times, each with its name for error messages."""
        return [
            (f"[[{name}]] {n}", table) for n, table in enumerate(self._table_list(self._found, name, ""), 1)
        ]

    def read_inner_tables(self, where: str, table: Mapping[str, Any], name: str, kind: type[T]) -> list[T]:
        """Returns the tables named ``name`` inside another table."""
        inner_tables = enumerate(self._table_list(table, name, f", {where}"), 1)
        return [
            self.parse_table(f"{where}, {name} {number}", kind, inner_table)
            for number, inner_table in inner_tables
        ]

    def parse_table(self, where: str, kind: type[T], value: Mapping[str, Any]) -> T:
        """Converts a table's values to an instance of the settings class ``kind``."""
        return load_settings(kind, value, where=f"{self._path}, {where}")

    def locate_errors(self, where: str, step: Callable[P, None], *values: P.args, **named: P.kwargs) -> None:
        """Runs a step. If it raises an InputError, adds the name of the table to the error's location."""
        try:
            step(*values, **named)
        except InputError as error:
            problem = f"{error.where}: {error.what}" if error.where else error.what
            raise InputError(problem, where=f"{self._path}, {where}", remedy=error.remedy) from None

    def resolve_path(self, file: str) -> Path:
        """Returns the absolute path of a file. Its path in the session is relative to the session's folder.
        Replaces $NAME by the value of the environment variable NAME.

        Raises:
            InputError: if the environment variable is not set.
        """
        text = os.path.expandvars(file)
        unknown = re.search(r"\$\{?(\w+)", text)
        if unknown:
            remedy = f"Set {unknown[1]} to a folder, or write the full path of the file."
            raise InputError(f"the environment variable {unknown[1]} is not set", where=file, remedy=remedy)
        return self._path.parent / Path(text).expanduser()

    def _table_list(self, tables: Mapping[str, Any], name: str, where: str) -> list[Mapping[str, Any]]:
        """Returns the tables of an array of tables, or an empty list if it is missing."""
        value = tables.get(name, [])
        if not isinstance(value, list) or not all(isinstance(item, Mapping) for item in value):
            remedy = f"Write one table [[{name}]] for each entry."
            raise InputError(
                f"{name} must be an array of tables", where=f"{self._path}{where}", remedy=remedy
            )
        return value
