"""enliven learn-room: makes a running edge learn the room again."""

from __future__ import annotations

from typing import Annotated

import typer

from enliven.commands.terminal import print_line


def learn_room(
    edge: Annotated[str, typer.Argument(metavar="HOST[:PORT]", help="Address of the edge.")],
) -> None:
    """Make a running edge learn the background and the floor again, for example after furniture was moved.

    The edge continues to run. It searches for the people again, and recognised people keep their numbers. If
    the edge has keys, the command needs the role operate.

    \b
      enliven learn-room 127.0.0.1
      enliven learn-room 192.168.1.20:5556
    """
    from enliven.wire import LearnRoom, parse_endpoint, send_order

    endpoint = parse_endpoint(edge)
    print_line(f"{endpoint.host}: {send_order(endpoint, LearnRoom())}")
