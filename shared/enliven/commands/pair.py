"""enliven pair: pairs this user's viewers with an edge that has keys."""

from __future__ import annotations

import platform
from typing import Annotated, Literal

import typer

from enliven.commands.terminal import print_line
from enliven.errors import InputError


def pair(
    edge: Annotated[str, typer.Argument(metavar="HOST[:PORT]", help="Address of the edge.")],
    code: Annotated[
        list[str] | None,
        typer.Argument(metavar="[CODE]", help="The six digits of the pairing code that the edge shows."),
    ] = None,
    role: Annotated[
        Literal["watch", "perform", "edit", "operate"],
        typer.Option(help="Rights of this viewer. Each role also has the rights of the roles before it."),
    ] = "perform",
    name: Annotated[
        str, typer.Option(help="Name of this viewer in the edge's list. Default: the computer's name.")
    ] = "",
    show_code: Annotated[
        bool, typer.Option("--show-code", help="Show the pairing code of the edge. Needs the role operate.")
    ] = False,
) -> None:
    """Pairs this user's viewers with an edge that has keys, so that the viewers can connect.

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
            f"{shown_code}, valid for {seconds} s"
            if shown_code
            else f"too many wrong codes were entered: the edge shows a new code in {seconds} s"
        )
        return
    if not digits:
        raise InputError(
            "the pairing code is missing",
            where="enliven pair",
            remedy="Add the six digits of the code: enliven pair HOST CODE",
        )
    store = KeyStore()
    paired_edge = pair_with_edge(endpoint, digits, role, name or platform.node() or "viewer", store)
    print_line(
        f"paired with {paired_edge.name} in the role {paired_edge.role}; fingerprint of the "
        f"edge's key: {fingerprint(paired_edge.public)}"
    )
    if paired_edge.role != role:
        print_line(
            f"Note: the edge grants at most the role {paired_edge.role} (setting pairing_role of the edge).",
            err=True,
        )
