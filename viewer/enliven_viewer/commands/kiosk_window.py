"""enliven kiosk-window: the window of a kiosk, without its supervisor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from enliven.commands.processes import terminate_as_interrupt
from enliven.errors import ResourceError
from enliven_viewer.doctor import has_display


def kiosk_window(
    profile: Annotated[Path, typer.Argument(help="The kiosk's profile, a TOML file.")],
    seconds: Annotated[
        float | None, typer.Option(min=0.0, help="Close the window after this number of seconds.")
    ] = None,
) -> None:
    """Open the window of a kiosk for visitors. The edge of the kiosk must already run.

    \b
      enliven kiosk-window FOYER.toml

    `enliven kiosk` starts this window and the edges, and restarts them if they fail. Ctrl+Alt+Q closes the
    window.
    """
    from enliven.kiosk.profile import load_profile

    kiosk = load_profile(profile)
    if not has_display():
        raise ResourceError(
            "no screen was found",
            where="kiosk",
            remedy="Start the kiosk in a graphical session, or on a console with cage: "
            "cage -- enliven kiosk ...",
        )
    from enliven_viewer.kiosk.window import run_kiosk_window

    with terminate_as_interrupt():
        run_kiosk_window(kiosk, profile.parent, seconds)
