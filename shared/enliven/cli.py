"""The command line: every package contributes its commands by the entry-point group ``enliven.commands``.

An installation of the edge only has no ``view``, because the viewer's package contains it. An entry point
names a function, or a typer group of functions. The function's typer annotations define the options, and its
docstring is the help. A command is imported when it is used; the list of all commands is read from their
source.
"""

from __future__ import annotations

import gc
import os
import sys
from typing import Any

import typer

from enliven import __version__
from enliven.commands.lazy import LazyCommands
from enliven.commands.run import has_display
from enliven.errors import EnlivenError, error_location
from enliven.files import file_fault, is_file_fault
from enliven.kernel_cache.program import name_program
from enliven.logs import escape_text, ignore_broken_stderr, split_log_options, start_logging
from enliven.supervision.lifetime import end_with_parent

_INTERRUPTED_EXIT_CODE = 130
"""Exit code of a run that Ctrl-C ended: 128 + SIGINT (2), the convention of shells."""
_WINDOW = "studio"
"""The command that runs if none is given."""
_GARBAGE_COLLECTION_THRESHOLD = 20_000
"""Number of new objects that triggers Python's garbage collection. Loading modules creates some 10^5
objects that stay, and with Python's own 700 collections cost 0.1 s of each start."""

HELP = """Step into any mesh and bring it alive.

\b
  enliven                                  the window: sketch, animate, perform (enliven studio)
  enliven run                              watch the chair move with a recorded person
  enliven run --recording TAKE.mcap --mesh HORSE.obj
  enliven import DEPTH/*.png -o take.mcap  convert a recording made by another program
  enliven track TAKE.mcap -o bodies.mcap   make takes of the people in a recording of depth
  enliven edge --sensor synthetic          the program at the camera: track and publish
  enliven stage put HORSE.obj              put a character on the stage of a running edge
  enliven view --edge 192.168.1.20         show the stage of an edge on this screen
  enliven studio SPIDER.glb                sketch, animate, cut and merge shapes
  enliven graph HORSE.obj -o horse.png     draw the deformation graph of a mesh
  enliven retarget WALK.bvh HORSE.glb -o out.glb   move a model by a motion
  enliven examples fit SESSION.toml -o out.glb     move a mesh by a few example poses
  enliven possess TAKE.mcap --mesh HORSE.obj -o out.glb   move a mesh by a recorded person
  enliven export TAKE.mcap -o take.glb     write a performance as .glb, .bvh or .mp4
  enliven doctor                           what this machine lacks, and how to fix it

A file in capitals is one of your own. Exit codes: 0 done, 1 a fault of enliven, 2 wrong usage, 3 an
input that cannot be used, 4 something this machine lacks (a port, a sensor, OpenGL), 130 interrupted.
--log-json, anywhere, makes every line JSON. --log-file FILE, anywhere, writes the log to a file of bounded
size.
"""


def main() -> None:
    """Runs the command line and ends the process with its exit code."""
    gc.set_threshold(_GARBAGE_COLLECTION_THRESHOLD, *gc.get_threshold()[1:])
    end_with_parent()
    arguments = sys.argv[1:]
    ignore_broken_stderr()
    code = _start_and_run(arguments)
    # Skip Python's final garbage collection, which takes 0.25 s although the process ends anyway.
    gc.freeze()
    sys.exit(code)


def _start_and_run(arguments: list[str]) -> int:
    """Starts the log with the options of the command line, and runs the remaining arguments. Returns the exit
    code.
    """
    try:
        arguments, options = split_log_options(arguments)
        start_logging(as_json=options.as_json, file=options.file)
    except ValueError as error:
        _print_error(f"{error}. Give it a path.")
        return 2
    except OSError as error:
        fault = file_fault(error, str(error.filename), "written")
        _print_error(str(fault))
        return fault.exit_code
    if (command := (*arguments, _WINDOW)[0]).isalnum():
        name_program(command)
    return run(arguments)


def run(arguments: list[str]) -> int:
    """Runs one command line and returns its exit code. User errors are printed, not raised."""
    try:
        code = application()(arguments, standalone_mode=False)
    except (typer.Abort, KeyboardInterrupt):
        return _INTERRUPTED_EXIT_CODE
    except typer.Exit as ended:
        return int(ended.exit_code)
    except EnlivenError as error:
        _print_error(str(error))
        return error.exit_code
    except OSError as error:
        return _report_os_error(error)
    except Exception as error:
        return _report_other_error(error)
    return code if isinstance(code, int) else 0


def _report_os_error(error: OSError) -> int:
    """Returns the exit code of an operating system error: the code for a missing resource, or the code for a
    fault of enliven.
    """
    if os.environ.get("ENLIVEN_DEBUG") or not is_file_fault(error):
        return _report_other_error(error)
    where = error.filename if isinstance(error.filename, str) else "a file"
    fault = file_fault(error, where, "used")
    _print_error(str(fault))
    return fault.exit_code


def _report_other_error(error: Exception) -> int:
    """Returns the exit code of wrong usage, or of an internal fault.

    Usage errors are recognised by their attributes: their class is click's in some versions of typer and
    typer's own copy in others.
    """
    if hasattr(error, "show") and hasattr(error, "exit_code"):
        vars(error)["message"] = escape_text(str(vars(error).get("message", "")))
        error.show()
        return int(error.exit_code)
    if os.environ.get("ENLIVEN_DEBUG"):
        raise error
    _print_error(f"a fault of enliven itself{error_location(error)}. ENLIVEN_DEBUG=1 shows all of it.")
    return 1


def application() -> Any:
    """Builds the command group of every installed command."""
    app = typer.Typer(
        cls=LazyCommands,
        help=HELP,
        rich_markup_mode=None,
        context_settings={"max_content_width": 100},
    )
    app.callback(invoke_without_command=True)(_main_command)
    return typer.main.get_command(app)


def _main_command(
    context: typer.Context,
    version: bool = typer.Option(False, "--version", help="Print the version and stop."),
) -> None:
    """Opens the window if no command is given and a window is possible. Otherwise shows the help."""
    if version:
        typer.echo(__version__)
        raise typer.Exit
    if context.invoked_subcommand is not None:
        return
    group: Any = context.command
    window = group.get_command(context, _WINDOW) if has_display() else None
    if window is None:
        typer.echo(context.get_help())
        raise typer.Exit
    context.invoke(window)


def _print_error(message: str) -> None:
    """Writes one line to standard error."""
    typer.echo(f"enliven: {escape_text(message)}", err=True)
