"""enliven kiosk-souvenirs: serves the photos and films of a kiosk's visitors to their phones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.processes import parent_is_gone, terminate_as_interrupt

if TYPE_CHECKING:
    from enliven.kiosk.profile import KioskProfile


def kiosk_souvenirs(
    profile: Annotated[Path, typer.Argument(help="The kiosk's profile, a TOML file.")],
) -> None:
    """Serve the souvenirs of a kiosk to the phones of its visitors.

    \b
      enliven kiosk-souvenirs FOYER.toml

    `enliven kiosk` starts this server if the profile makes souvenirs. The server sends a souvenir only to a
    phone that opens the secret address of the souvenir. It deletes a souvenir after souvenir.keep minutes. If
    souvenir.certificate is set, the server uses TLS.
    """
    from enliven.kiosk.profile import load_profile
    from enliven_viewer.language import find_language, set_language
    from enliven_viewer.souvenirs.server import serve_souvenirs

    kiosk = _resolve_certificate(load_profile(profile), profile.absolute().parent)
    set_language(find_language(kiosk.story.language))
    with terminate_as_interrupt():
        try:
            serve_souvenirs(kiosk, str(profile), parent_is_gone)
        except KeyboardInterrupt:
            # The server has shut down properly. It raises the signal again that stopped it.
            return


def _resolve_certificate(kiosk: KioskProfile, folder: Path) -> KioskProfile:
    """Returns the profile with the paths of its certificate and key resolved against a folder."""
    souvenir = kiosk.souvenir
    certificate, key = (
        str(folder / name) if name else "" for name in (souvenir.certificate, souvenir.certificate_key)
    )
    return replace(kiosk, souvenir=replace(souvenir, certificate=certificate, certificate_key=key))
