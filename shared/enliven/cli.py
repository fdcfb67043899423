"""The one command line: every package contributes its commands by the entry-point group ``enliven.commands``.

An edge-only install has no ``view``, because the viewer's package is what brings it. An entry point names a
function, or a typer group of them; typer annotations are the options, the docstring is the help.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import typer

from enliven import __version__
from enliven.errors import EnlivenError
from enliven.logs import start_logging

_ORDER = (
    "run",
    "edge",
    "view",
    "import",
    "record",
    "replay",
    "recover",
    "calibrate",
    "synthesize",
    "graph",
    "retarget",
    "examples",
    "doctor",
)
_INTERRUPTED = 130

HELP = """Step into any mesh and bring it alive.

\b
  enliven run                              watch the chair move with a recorded person
  enliven run --recording take.mcap --mesh horse.obj
  enliven import depth/*.png -o take.mcap  bring in a recording made by others
  enliven edge --sensor synthetic          the program beside the camera
  enliven view --edge 192.168.1.20         the program on a screen
  enliven studio spider.glb                sketch, animate, cut and merge shapes
  enliven graph horse.obj -o horse.png     what a mesh is possessed by
  enliven retarget walk.bvh horse.glb -o out.glb   move a model by a motion
  enliven examples fit session.toml -o out.glb     move a mesh by a few example poses
  enliven doctor                           what this machine lacks, and how to mend it

Exit codes: 0 done, 1 a fault of enliven, 2 wrong usage, 3 an input that cannot be used, 4 something this
machine lacks (a port, a sensor, OpenGL), 130 interrupted. --log-json, anywhere, makes every line JSON.
"""


def main() -> None:
    """Runs the command line and ends the process with its exit code."""
    arguments = sys.argv[1:]
    start_logging(as_json="--log-json" in arguments)
    sys.exit(run([a for a in arguments if a != "--log-json"]))


def run(arguments: list[str]) -> int:
    """The exit code of one command line; user errors are printed, not raised."""
    try:
        code = application()(arguments, standalone_mode=False)
    except (typer.Abort, KeyboardInterrupt):
        return _INTERRUPTED
    except typer.Exit as ended:
        return int(ended.exit_code)
    except EnlivenError as error:
        _complain(str(error))
        return error.exit_code
    except Exception as error:
        return _other_failure(error)
    return code if isinstance(code, int) else 0


def _other_failure(error: Exception) -> int:
    """The exit code of wrong usage, or of a fault of our own.

    Usage errors are known by what they can do: their class is click's in some versions of typer and typer's
    own copy in others.
    """
    if hasattr(error, "show") and hasattr(error, "exit_code"):
        error.show()
        return int(error.exit_code)
    if os.environ.get("ENLIVEN_DEBUG"):
        raise error
    _complain(f"a fault of enliven itself: {type(error).__name__}: {error}. ENLIVEN_DEBUG=1 shows where.")
    return 1


def application() -> Any:
    """The command group with every installed command."""
    app = typer.Typer(
        help=HELP, no_args_is_help=True, rich_markup_mode=None, context_settings={"max_content_width": 100}
    )
    app.callback(invoke_without_command=True)(_root)
    for entry in _contributed():
        found = _loaded(entry)
        if isinstance(found, typer.Typer):
            app.add_typer(found, name=entry.name)
        else:
            app.command(entry.name)(found)
    return typer.main.get_command(app)


def _root(version: bool = typer.Option(False, "--version", help="Print the version and stop.")) -> None:
    if version:
        typer.echo(__version__)
        raise typer.Exit


def _contributed() -> list[EntryPoint]:
    """The commands of all installed packages, the usual ones first."""
    found = {e.name: e for e in entry_points(group="enliven.commands")}
    return sorted(found.values(), key=lambda e: (_ORDER.index(e.name) if e.name in _ORDER else 99, e.name))


def _loaded(entry: EntryPoint) -> Callable[..., Any] | typer.Typer:
    """The command's function, or its group of commands; where its package is broken, one that says so."""
    try:
        function: Callable[..., Any] | typer.Typer = entry.load()
        return function
    except ImportError as error:
        reason = str(error)

        def broken() -> None:
            raise EnlivenError(
                f"the command {entry.name!r} cannot be loaded: {reason}", mend="Install it again."
            )

        return broken


def _complain(message: str) -> None:
    """One line on standard error."""
    typer.echo(f"enliven: {message}", err=True)
