"""enliven kiosk: runs an unattended installation from one profile."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.lazy import list_installed_commands, run_command
from enliven.commands.processes import enliven_command
from enliven.commands.run import has_display
from enliven.commands.terminal import print_line
from enliven.errors import EnlivenError, InputError, ResourceError

if TYPE_CHECKING:
    from enliven.kiosk.profile import KioskProfile
    from enliven.supervision.child import Program

STATE_VARIABLE = "STATE_DIRECTORY"
"""Environment variable with the folder in which an edge stores the state of its stage. systemd also sets this
variable."""

MIN_PAGE_FROZEN_S = 30.0
"""Minimum time without progress, in seconds, until the health page or the souvenir server is restarted. It is
long, because the show continues without them.
"""
SOUVENIR_LIBRARIES = ("segno", "starlette", "uvicorn")
"""Libraries for souvenirs, from the optional dependency group ``enliven-viewer[web]``."""


def kiosk(
    profile: Annotated[Path, typer.Argument(help="Profile of the kiosk (TOML file).")],
    window: Annotated[
        bool, typer.Option("--window/--no-window", help="Open the kiosk window on this computer's screen.")
    ] = True,
    check: Annotated[
        bool, typer.Option("--check", help="Print all mistakes in the profile, and start nothing.")
    ] = False,
    edge: Annotated[
        str,
        typer.Option(
            "--edge", metavar="NAME", help="Run only this edge of the profile. For services of systemd."
        ),
    ] = "",
) -> None:
    """Run a kiosk: edges, a full-screen window, and a health page. Programs that end or freeze are restarted.

    The health page is at http://127.0.0.1:5590. Ctrl-C or SIGTERM ends all programs. To start a kiosk when
    the computer starts, use enliven install-kiosk instead.

    \b
      enliven kiosk PROFILE.toml
      enliven kiosk PROFILE.toml --check
      enliven kiosk PROFILE.toml --no-window
    """
    from enliven.kiosk.checks import find_mistakes
    from enliven.kiosk.profile import load_profile

    path = profile.absolute()
    if edge:
        _run_edge_in_process(edge, path)
    mistakes: list[EnlivenError] = find_mistakes(path)
    if not any(isinstance(mistake, InputError) for mistake in mistakes):
        mistakes += _find_lacks(window)
        mistakes += _find_missing_libraries(load_profile(path))
        mistakes += _find_taken_screen(load_profile(path)) if window else []
    if mistakes:
        for mistake in mistakes:
            print_line(f"enliven: {mistake}", err=True)
        raise typer.Exit(mistakes[0].exit_code)
    settings = load_profile(path)
    if check:
        print_line(f"{profile}: no mistakes were found, and the kiosk can start")
        return
    raise typer.Exit(_supervise(settings, path, window))


def _supervise(settings: KioskProfile, path: Path, window: bool) -> int:
    """Runs all programs of a kiosk until it is stopped. Returns the exit code."""
    from enliven.supervision.records import RUNTIME_VARIABLE, runtime_folder
    from enliven.supervision.supervisor import RecordFolders, Supervisor

    runtime = runtime_folder()
    os.environ[RUNTIME_VARIABLE] = str(runtime)
    programs = kiosk_programs(settings, path, window=window)
    print_line(f"{settings.name}: the health page is at http://127.0.0.1:{settings.health.port}", err=True)
    return Supervisor(programs, RecordFolders(runtime), settings.care.restart_at).run()


def kiosk_programs(settings: KioskProfile, path: Path, *, window: bool = True) -> list[Program]:
    """Returns the programs of a kiosk in the order of their start. They do not wait for each other.

    Args:
        settings: the profile.
        path: path of the profile's file.
        window: False leaves out the window.
    """
    from enliven.files import user_data_folder
    from enliven.kiosk.programs import (
        edge_arguments,
        health_arguments,
        local_edges,
        service_name,
        souvenir_arguments,
        window_arguments,
    )
    from enliven.supervision.child import Program

    frozen_after_s = settings.care.frozen_after
    state = {STATE_VARIABLE: str(user_data_folder())}
    programs = [
        Program(
            service_name(name),
            enliven_command(edge_arguments(name, settings, path.parent)),
            frozen_after_s=frozen_after_s,
            environment=state,
        )
        for name in local_edges(settings)
    ]
    if window:
        command = enliven_command(window_arguments(path))
        # If the window ends without a failure, an operator has closed it. Then the kiosk ends.
        programs.append(
            Program("window", command, restart="failure", leads=True, frozen_after_s=frozen_after_s)
        )
    pages = {"health": health_arguments(path)}
    if settings.souvenir.kind:
        pages["souvenirs"] = souvenir_arguments(path)
    for name, words in pages.items():
        frozen_s = max(frozen_after_s, MIN_PAGE_FROZEN_S)
        programs.append(Program(name, enliven_command(words), frozen_after_s=frozen_s))
    return programs


def _find_lacks(window: bool) -> list[EnlivenError]:
    """Returns an error for each requirement of a kiosk that is missing on this computer: programs, a display,
    or a free screen."""
    problems: list[EnlivenError] = []
    commands = list_installed_commands()
    required_packages = {
        "edge": "enliven-edge",
        "health": "enliven",
        **({"kiosk-window": "enliven-viewer"} if window else {}),
    }
    for command, package in required_packages.items():
        if command not in commands:
            problems.append(
                ResourceError(
                    f"{package} is not installed on this computer", remedy=f"Type: pip install {package}"
                )
            )
    if window and not has_display():
        remedy = (
            "Start the kiosk on the computer's own screen, use --no-window, or install the kiosk: "
            "enliven install-kiosk."
        )
        problems.append(ResourceError("no screen was found", where="DISPLAY, WAYLAND_DISPLAY", remedy=remedy))
    return problems


def _find_missing_libraries(settings: KioskProfile) -> list[EnlivenError]:
    """Returns an error if the profile enables souvenirs, but a library for them is not installed."""
    missing_libraries = [name for name in SOUVENIR_LIBRARIES if importlib.util.find_spec(name) is None]
    if not settings.souvenir.kind or not missing_libraries:
        return []
    remedy = 'Type: pip install "enliven-viewer[web]"'
    return [
        ResourceError(
            f"the libraries for souvenirs are not installed: {', '.join(missing_libraries)}",
            where="souvenir.kind",
            remedy=remedy,
        )
    ]


def _find_taken_screen(settings: KioskProfile) -> list[EnlivenError]:
    """Returns an error if another kiosk of this user shows its window on the same screen."""
    from enliven.kiosk.screen_lock import is_screen_taken

    number = settings.screen.number
    if not is_screen_taken(number):
        return []
    remedy = "Stop the other kiosk, or choose another screen.number in the profile."
    return [
        ResourceError(
            "the window of another kiosk is already on this screen", where=f"screen {number}", remedy=remedy
        )
    ]


def _run_edge_in_process(name: str, path: Path) -> None:
    """Runs an edge of the profile in this process. A separate process would delay each restart by another
    start of the Python interpreter.

    Raises:
        InputError: if the profile cannot be used, or has no such edge on this computer.
        Exit: when the edge has ended.
    """
    from enliven.kiosk.profile import load_profile
    from enliven.kiosk.programs import edge_arguments, local_edges

    settings = load_profile(path)
    if name not in local_edges(settings):
        names = ", ".join(local_edges(settings)) or "none"
        raise InputError(
            f"the profile has no edge {name!r} on this computer",
            where=str(path),
            remedy=f"Edges of the profile on this computer: {names}.",
        )
    raise typer.Exit(run_command(edge_arguments(name, settings, path.parent)))
