"""enliven pair: pairs this user's viewers with an edge that has keys."""

from __future__ import annotations

import platform
from typing import Annotated, Literal

import typer

from enliven.commands.terminal import print_line
from enliven.errors import InputError


def pair(
    edge: Annotated[str, typer.Argument(metavar="HOST[:PORT]", help="The edge's address.")],
    code: Annotated[
        list[str] | None, typer.Argument(metavar="[CODE]", help="The six digits that the edge shows.")
    ] = None,
    role: Annotated[
        Literal["watch", "perform", "edit", "operate"],
        typer.Option(help="The rights of this viewer. Each role includes the ones before it."),
    ] = "perform",
    name: Annotated[
        str, typer.Option(help="Name of this viewer in the edge's list; default: the computer's.")
    ] = "",
    show_code: Annotated[
        bool, typer.Option("--show-code", help="Show the edge's code; needs the role operate.")
    ] = False,
) -> None:
    """Pairs with an edge that has keys, so that this user's viewers can connect.

    The edge shows a code of six digits in its terminal or log for ten minutes after its start. Roles:
    watch (receive only), perform (possess characters), edit (add, resize and remove characters, scan),
    operate (lock the cast, learn the room again, show pairing codes).

    \b
      enliven pair 192.168.1.20 123456
      enliven pair 192.168.1.20 123456 --role operate
      enliven pair 127.0.0.1 --show-code
    """
    from enliven.keys.key_files import KeyStore, fingerprint
    from enliven.wire import pair_with_edge, parse_endpoint, show_pairing_code

    endpoint, digits = parse_endpoint(edge), "".join(code or [])
    if show_code:
        shown_code, seconds = show_pairing_code(endpoint)
        print_line(
            f"{shown_code}, for {seconds} s"
            if shown_code
            else f"too many tries: a new code follows in {seconds} s"
        )
        return
    if not digits:
        raise InputError(
            "the code is missing", where="enliven pair", remedy="Give the six digits: HOST CODE."
        )
    store = KeyStore()
    paired_edge = pair_with_edge(endpoint, digits, role, name or platform.node() or "viewer", store)
    print_line(
        f"paired with {paired_edge.name} as {paired_edge.role}; its key: {fingerprint(paired_edge.public)}"
    )
    if paired_edge.role != role:
        print_line(
            f"Note: the edge grants at most the role {paired_edge.role} (its setting pairing_role).", err=True
        )
