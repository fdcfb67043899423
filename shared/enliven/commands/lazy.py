"""The group of all installed commands. A command's module is imported only when the command is used."""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Sequence
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from enliven.errors import EnlivenError
from enliven.kernel_cache.program import name_program

ENTRY_POINT_GROUP = "enliven.commands"
"""The entry-point group through which packages add commands."""

_COMMAND_ORDER = (
    "run",
    "edge",
    "relay",
    "stage",
    "view",
    "web",
    "import",
    "sensors",
    "record",
    "replay",
    "recover",
    "calibrate",
    "synthesize",
    "graph",
    "retarget",
    "examples",
    "possess",
    "export",
    "keys",
    "pair",
    "learn-room",
    "health",
    "kiosk",
    "install-kiosk",
    "doctor",
)


class LazyCommands(TyperGroup):
    """A command group with a command for each entry point. The module of a command is imported when the
    command is used."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Returns the names of all installed commands, in the order of ``_COMMAND_ORDER``, then by name."""
        return list(list_installed_commands())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Imports and returns the command with that name, or returns None if it does not exist."""
        entry = list_installed_commands().get(cmd_name)
        if entry is not None and cmd_name not in self.commands:
            self.commands[cmd_name] = _load_command(entry)
        return self.commands.get(cmd_name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Resolves a command. If the name is misspelt, imports all commands so that the base class can
        suggest one."""
        if args and args[0] not in list_installed_commands():
            for name in list_installed_commands():
                self.get_command(ctx, name)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Writes one line for each command without importing the commands."""
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, command_summary(entry)) for name, entry in list_installed_commands().items()]
            )


def list_installed_commands() -> dict[str, EntryPoint]:
    """Returns the commands of all installed packages by name, in the order of ``_COMMAND_ORDER``, then by
    name."""
    entries = {entry.name: entry for entry in entry_points(group=ENTRY_POINT_GROUP)}
    order = sorted(
        entries,
        key=lambda name: (
            _COMMAND_ORDER.index(name) if name in _COMMAND_ORDER else len(_COMMAND_ORDER),
            name,
        ),
    )
    return {name: entries[name] for name in order}


def run_command(words: Sequence[str]) -> int:
    """Runs another command in this process in the same way as the command line, and returns its exit code.

    Args:
        words: the name of the command, and its arguments.

    Raises:
        EnlivenError: if the command raises it.
    """
    name, *arguments = words
    name_program(name)
    command = _load_command(list_installed_commands()[name])
    code = command.main(args=arguments, prog_name=f"enliven {name}", standalone_mode=False)
    return code if isinstance(code, int) else 0


def command_summary(entry: EntryPoint) -> str:
    """Reads the first line of a command's docstring from its source file. Returns an empty string if there is
    no source file."""
    try:
        spec = importlib.util.find_spec(entry.module)
        tree = ast.parse(Path(spec.origin).read_bytes()) if spec and spec.origin else ast.Module([], [])
    except (ImportError, OSError, SyntaxError, ValueError):
        return ""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and _defines_command(node, entry.attr):
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""


def _defines_command(function: ast.FunctionDef, name: str) -> bool:
    """Returns True if a function is the command ``name``, or the callback of the command group ``name``."""
    decorators = {ast.unparse(decorator) for decorator in function.decorator_list}
    return function.name == name or f"{name}.callback()" in decorators


def _load_command(entry: EntryPoint) -> Any:
    """Loads the command, or the command group, of an entry point."""
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.callback()(lambda: None)
    command = _load_function(entry)
    if isinstance(command, typer.Typer):
        app.add_typer(command, name=entry.name)
    else:
        app.command(entry.name)(command)
    group: Any = typer.main.get_command(app)
    return group.commands[entry.name]


def _load_function(entry: EntryPoint) -> Any:
    """Loads the command's function, or its typer group. If the import fails, returns a function that raises
    an error."""
    try:
        return entry.load()
    except ImportError as error:
        reason = str(error)

        def broken() -> None:
            raise EnlivenError(
                f"the command {entry.name!r} cannot be loaded: {reason}",
                remedy="Install the package of this command again.",
            )

        return broken
