"""Checks the names of body parts on the command line before anything is started."""

from __future__ import annotations

import typer

from enliven.errors import InputError


def check_parts(texts: list[str] | None) -> list[str] | None:
    """Checks the values of --parts and returns them. An example is "legs", or "legs / torso" for several
    performers.

    Raises:
        typer.BadParameter: for an unknown body part. The message suggests the nearest one.
    """
    from enliven.person import parse_parts

    try:
        for text in texts or []:
            parse_parts(part.strip() for part in text.split("/"))
    except InputError as error:
        raise typer.BadParameter(str(error)) from None
    return texts
