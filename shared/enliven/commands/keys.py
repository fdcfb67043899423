"""enliven keys: makes and lists the keys of this user, and forgets paired viewers and edges."""

from __future__ import annotations

from typing import Annotated

import typer

from enliven.commands.terminal import print_line
from enliven.errors import InputError

keys = typer.Typer(add_completion=False, rich_markup_mode=None, no_args_is_help=True)


@keys.callback()
def _keys() -> None:
    """Makes and lists the keys that limit an edge to paired viewers.

    If the user of an edge has keys, the edge encrypts its connections and accepts only viewers that were
    paired by enliven pair. All edges and viewers of a user on a computer use the same pair of keys.

    \b
      enliven keys make
      enliven keys list
      enliven keys show
      enliven keys forget NAME
    """


@keys.command()
def make(
    overwrite: Annotated[
        bool,
        typer.Option(
            "--overwrite", help="Replace existing keys. All viewers and edges must then be paired again."
        ),
    ] = False,
) -> None:
    """Makes the keys of this user on this computer."""
    from enliven.keys.key_files import KeyStore, fingerprint

    store = KeyStore()
    pair = store.create_own_pair(overwrite=overwrite)
    print_line(f"{store.own_path}: {fingerprint(pair.public)}")


@keys.command()
def show() -> None:
    """Prints the fingerprint of this user's keys, for comparison with the list of a paired computer."""
    from enliven.keys.key_files import KeyStore, fingerprint

    store = KeyStore()
    own_keys = store.load_own_pair()
    if own_keys is None:
        raise InputError(
            "this user has no keys on this computer",
            where=str(store.own_path),
            remedy="Make the keys: enliven keys make",
        )
    print_line(fingerprint(own_keys.public))


@keys.command(name="list")
def list_keys() -> None:
    """Lists the keys of this user, the paired viewers and the paired edges."""
    from enliven.keys.key_files import KeyStore, fingerprint

    store, problems = KeyStore(), list[str]()
    try:
        own_keys = store.load_own_pair()
        own_text = (
            "none (enliven keys make creates keys)" if own_keys is None else fingerprint(own_keys.public)
        )
    except InputError as error:
        own_text = "damaged"
        problems.append(str(error))
    print_line(f"own keys  {own_text}")
    for viewer in store.load_viewers(problems).values():
        print_line(
            f"viewer    {fingerprint(viewer.public)}  {viewer.role:7}  {viewer.paired:10}  {viewer.name}"
        )
    for edge in store.load_edges(problems):
        edge_text = f"{edge.name} at {edge.host}:{edge.control_port}"
        print_line(f"edge      {fingerprint(edge.public)}  {edge.role:7}  {edge.paired:10}  {edge_text}")
    for problem in problems:
        print_line(f"enliven: {problem}", err=True)
    if problems:
        raise typer.Exit(InputError.exit_code)


@keys.command()
def forget(
    peer: Annotated[
        str, typer.Argument(help="Name, address, or start of the fingerprint of a paired viewer or edge.")
    ],
) -> None:
    """Forgets a paired viewer or edge. A running edge disconnects a forgotten viewer within seconds."""
    from enliven.keys.key_files import KeyStore, fingerprint

    for forgotten in KeyStore().forget(peer):
        print_line(f"removed: {forgotten.name}, {fingerprint(forgotten.public)}")
