"""The command line. Each package provides its commands through the entry-point group ``enliven.commands``.

For example, ``view`` exists only if the viewer's package is installed. An entry point refers to a function,
or to a typer group of functions. The function's typer annotations define the options, and its docstring is
the help text. A command is imported only when it is used. The list of all commands is read from their source
files.
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
"""Exit code of a command that was ended by Ctrl-C: 128 + SIGINT (2), by the convention of shells."""
_WINDOW = "studio"
"""The command that runs if no command is given."""
_GARBAGE_COLLECTION_THRESHOLD = 20_000
"""Number of new objects that triggers Python's garbage collection. Loading modules creates about 10^5
permanent objects. With Python's default of 700, collections would take 0.1 s of each start."""

HELP = """Step into any mesh and bring it alive.

\b
  enliven                                  open the window: sketch, animate, perform (enliven studio)
  enliven run                              move a chair by a recorded person
  enliven run --recording TAKE.mcap --mesh HORSE.obj
  enliven import DEPTH/*.png -o take.mcap  convert a recording of another program
  enliven track TAKE.mcap -o bodies.mcap   find the people in a depth recording
  enliven edge --sensor synthetic          run the program at the camera: track and publish
  enliven stage put HORSE.obj              put a character on the stage of a running edge
  enliven view --edge 192.168.1.20         show the stage of an edge on this screen
  enliven studio SPIDER.glb                sketch, animate, cut and merge shapes
  enliven graph HORSE.obj -o horse.png     draw the deformation graph of a mesh
  enliven retarget WALK.bvh HORSE.glb -o out.glb   move a model by a recorded motion
  enliven examples fit SESSION.toml -o out.glb     move a mesh by a few example poses
  enliven possess TAKE.mcap --mesh HORSE.obj -o out.glb   move a mesh by a recorded person
  enliven export TAKE.mcap -o take.glb     write a performance as .glb, .bvh or .mp4
  enliven doctor                           check this computer, and suggest remedies

Replace file names in capitals by your own files. Exit codes: 0 success, 1 an internal error of enliven,
2 wrong usage, 3 an invalid input, 4 a missing resource of this computer (a port, a sensor, OpenGL), 130
interrupted. Two options can be used with every command: --log-json writes each log line as JSON, and
--log-file FILE writes the log to a file of limited size.
"""


def main() -> None:
    """Runs the command line and ends the process with its exit code."""
    gc.set_threshold(_GARBAGE_COLLECTION_THRESHOLD, *gc.get_threshold()[1:])
    end_with_parent()
    arguments = sys.argv[1:]
    ignore_broken_stderr()
    code = _start_and_run(arguments)
    # Skip Python's final garbage collection. It would take 0.25 s without any use, because the process ends.
    gc.freeze()
    sys.exit(code)


def _start_and_run(arguments: list[str]) -> int:
    """Starts logging with the log options in the arguments, and runs the remaining command line. Returns the
    exit code.
    """
    try:
        arguments, options = split_log_options(arguments)
        start_logging(as_json=options.as_json, file=options.file)
    except ValueError as error:
        _print_error(f"{error}. Type: --log-file FILE")
        return 2
    except OSError as error:
        fault = file_fault(error, str(error.filename), "written")
        _print_error(str(fault))
        return fault.exit_code
    if (command := (*arguments, _WINDOW)[0]).isalnum():
        name_program(command)
    return run(arguments)


def run(arguments: list[str]) -> int:
    """Runs one command line and returns its exit code. Errors are printed and not raised."""
    try:
        code = build_command_group()(arguments, standalone_mode=False)
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
    """Prints an operating system error. Returns the exit code for a missing resource, or for an internal
    error of enliven.
    """
    if os.environ.get("ENLIVEN_DEBUG") or not is_file_fault(error):
        return _report_other_error(error)
    location = error.filename if isinstance(error.filename, str) else "a file"
    fault = file_fault(error, location, "used")
    _print_error(str(fault))
    return fault.exit_code


def _report_other_error(error: Exception) -> int:
    """Prints an error. Returns the exit code for wrong usage, or for an internal error of enliven.

    Usage errors are recognised by their attributes, because their class is click's in some versions of typer,
    and typer's own copy in others.
    """
    if hasattr(error, "show") and hasattr(error, "exit_code"):
        vars(error)["message"] = escape_text(str(vars(error).get("message", "")))
        error.show()
        return int(error.exit_code)
    if os.environ.get("ENLIVEN_DEBUG"):
        raise error
    _print_error(
        f"an internal error of enliven{error_location(error)}. Set ENLIVEN_DEBUG=1 to see the full error."
    )
    return 1


def build_command_group() -> Any:
    """Builds the command group with all installed commands."""
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
    """Prints one line to standard error."""
    typer.echo(f"enliven: {escape_text(message)}", err=True)
