"""enliven health: serves the health page of an installation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.processes import parent_is_gone, terminate_as_interrupt
from enliven.commands.terminal import print_line
from enliven.errors import InputError

if TYPE_CHECKING:
    from enliven.kiosk.profile import KioskProfile


def health(
    profile: Annotated[
        Path | None,
        typer.Argument(metavar="[PROFILE]", help="Profile of the kiosk (TOML file)."),
    ] = None,
    edge: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST[:PORT]",
            help="Monitor this edge instead of the edges in the profile. Can be repeated.",
        ),
    ] = None,
    host: Annotated[
        str,
        typer.Option(help="Network address of the page. Default: the address in the profile."),
    ] = "",
    port: Annotated[
        int,
        typer.Option(help="Network port of the page. Default: the port in the profile.", min=0, max=65535),
    ] = 0,
    test_alert: Annotated[
        bool,
        typer.Option(
            "--test-alert", help="Send a test alert to the webhook and the command of the profile, and stop."
        ),
    ] = False,
) -> None:
    """Serves a page with the health of edges, programs and this computer.

    The page is at http://127.0.0.1:5590, metrics for Prometheus are at /metrics, and JSON for scripts is at
    /health (status 503 if something fails). To serve other computers, the page needs a password and TLS,
    which are set under [health] in the profile. Alerts are set under [alerts] in the profile.

    \b
      enliven health
      enliven health PROFILE.toml
      enliven health --edge 192.168.1.20
      enliven health PROFILE.toml --test-alert
    """
    from enliven.health_page.server import send_test_alert, serve_health
    from enliven.kiosk.profile import KioskEdge, KioskProfile, load_profile

    settings = KioskProfile() if profile is None else load_profile(profile)
    if profile is not None:
        settings = _resolve_paths(settings, profile.parent)
    if test_alert:
        if profile is None:
            raise InputError(
                "--test-alert needs the profile that contains the alert settings",
                remedy="Type: enliven health PROFILE --test-alert",
            )
        print_line(f"test alert sent to: {', '.join(send_test_alert(settings))}")
        return
    if edge:
        settings = replace(settings, edges={address: KioskEdge(address=address) for address in edge})
    page = settings.health
    settings = replace(settings, health=replace(page, host=host or page.host, port=port or page.port))
    with terminate_as_interrupt():
        try:
            serve_health(settings, parent_is_gone)
        except KeyboardInterrupt:
            # The server shuts down properly, and then raises the signal that stopped it a second time.
            return


def _resolve_paths(settings: KioskProfile, folder: Path) -> KioskProfile:
    """Returns a profile with absolute paths. In the file, they are relative to its folder."""

    def resolve(path: str) -> str:
        return str(folder.absolute() / path) if path else ""

    page = settings.health
    return replace(
        settings,
        health=replace(
            page,
            password_file=resolve(page.password_file),
            certificate=resolve(page.certificate),
            certificate_key=resolve(page.certificate_key),
        ),
        souvenir=replace(settings.souvenir, certificate=resolve(settings.souvenir.certificate)),
        care=replace(settings.care, recordings=resolve(settings.care.recordings)),
    )
