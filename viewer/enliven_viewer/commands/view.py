"""enliven view: shows characters on a screen."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands import say, terminate_as_interrupt
from enliven.errors import InputError, ResourceError
from enliven.files import require_folder
from enliven.settings import load_settings
from enliven_viewer.doctor import has_display
from enliven_viewer.settings import ViewerSettings, WindowStart, with_size

if TYPE_CHECKING:
    from enliven_viewer.link import EdgeFeed, TakeFeed

DEFAULT_ADDRESS = "127.0.0.1"


def view(
    take: Annotated[Path | None, typer.Argument(help="Play this take instead of following an edge.")] = None,
    edge: Annotated[
        list[str] | None,
        typer.Option(
            help=f"Address of an edge: HOST or HOST:PORT. Repeat it for more. Default {DEFAULT_ADDRESS}."
        ),
    ] = None,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="Port of the edge's poses.")] = None,
    control_port: Annotated[
        int | None,
        typer.Option(min=1, max=65535, help="Port of the edge's commands. Default: the next port."),
    ] = None,
    film: Annotated[Path | None, typer.Option(help="Write this MP4 instead of opening a window.")] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="Write this contact sheet (PNG); needs no window.")
    ] = None,
    size: Annotated[str | None, typer.Option(help="Size of the window or film, such as 1920x1080.")] = None,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="Stop after this number of seconds.")] = None,
    wait: Annotated[
        float | None,
        typer.Option(min=0.0, help="Seconds that a film waits for an edge; default: the settings."),
    ] = None,
    hud: Annotated[bool, typer.Option(help="Show text over the picture.")] = True,
    fullscreen: Annotated[
        bool,
        typer.Option("--fullscreen", help="Fill the screen, for an audience; F11 shows the menus again."),
    ] = False,
    settings: Annotated[Path | None, typer.Option(help="A TOML file of settings.")] = None,
) -> None:
    """Watch characters move: live from an edge, or from a take; in a window, or as a film.

    \b
      enliven view                                 the edge on this machine, in a window
      enliven view --edge 192.168.1.20             an edge on the network
      enliven view --edge 10.0.0.5 --edge 10.0.0.6  two edges, side by side
      enliven view TAKE.mcap                       play a take: space, arrows, drag the timeline
      enliven view --fullscreen                    for an audience: no menus, no numbers, no keys
      enliven view --fullscreen --no-hud           an installation: the picture alone
      enliven view --film out.mp4 --sheet out.png  no display needed; ends with the edge's stream
      enliven view TAKE.mcap --film out.mp4 --size 1920x1080 --no-hud

    It is the window of `enliven studio` in its Play workspace; H shows the keys.
    """
    chosen = with_size(load_settings(ViewerSettings, settings) if settings else ViewerSettings(), size)
    if wait is not None:
        chosen = replace(chosen, film=replace(chosen.film, patience=wait))
    require_folder(film, sheet)
    _require_take(take)
    filming = film is not None or sheet is not None
    if not filming and not has_display():
        raise ResourceError(
            "no display was found to open a window on",
            where="enliven view",
            mend="Render without one: enliven view --film out.mp4 --sheet out.png",
        )
    addresses = _parse_addresses(edge or [DEFAULT_ADDRESS], port, control_port)
    with terminate_as_interrupt():
        if filming:
            _make_film(take, addresses, film, sheet, chosen, seconds, hud)
        else:
            start = WindowStart(_make_title(take), not hud, fullscreen, escape_ends=True, audience=True)
            _open_window(take, addresses, chosen, seconds, start)


_OTHER_COMMANDS = {
    ".glb": "Play it in enliven studio {0}, or make a film of it: enliven export {0} -o film.mp4",
    ".enliven": "Open it: enliven studio {0}",
    ".mp4": "Any player of films shows it",
}
_OTHER_COMMANDS |= dict.fromkeys((".gltf", ".vrm", ".bvh"), _OTHER_COMMANDS[".glb"])
"""Advice for files that are not takes, by file extension."""


def _require_take(take: Path | None) -> None:
    """Raises an InputError with advice if the file is of a type that another command plays."""
    if take is not None and take.suffix.lower() in _OTHER_COMMANDS and take.exists():
        mend = _OTHER_COMMANDS[take.suffix.lower()].format(take) + "."
        raise InputError("this is not a take", where=str(take), mend=mend)


def _make_film(
    take: Path | None,
    addresses: list[str],
    film: Path | None,
    sheet: Path | None,
    settings: ViewerSettings,
    seconds: float | None,
    hud: bool,
) -> None:
    """Makes a film and a contact sheet. Heavy modules are imported only here, so that the help appears
    quickly.
    """
    from enliven_viewer.film import make_film
    from enliven_viewer.playback import Document, Timeline

    feed = _open_feed(take, addresses)
    document = Document(Timeline(settings.playback, bounded=False))
    with contextlib.closing(feed):
        report = make_film(
            feed, document, film, sheet, settings, seconds=seconds, title=_make_title(take), caption=hud
        )
    written = " and ".join(str(path) for path in (film, sheet) if path)
    say(f"enliven: {report.pictures} pictures, {report.seconds:.1f} s, are in {written}")


def _open_window(
    take: Path | None,
    addresses: list[str],
    settings: ViewerSettings,
    seconds: float | None,
    opening: WindowStart,
) -> None:
    """Opens the window in its Play workspace."""
    from enliven_viewer.studio import StudioSettings, StudioWindow
    from enliven_viewer.studio.editor import Editor
    from enliven_viewer.studio.workspace import Workspace

    chosen = StudioSettings(settings.render, settings.width, settings.height)
    workspace = Workspace.new(Editor(chosen))
    workspace.perform.active_workspace = "Play"
    if take is not None:
        workspace.perform.follow_take(take, settings.playback)
    else:
        for address in addresses:
            workspace.perform.add_secondary(address, settings.playback)
    StudioWindow(workspace, opening=opening).run(seconds=seconds)


def _make_title(take: Path | None) -> str:
    return f"enliven · {take.name}" if take else "enliven"


def _open_feed(take: Path | None, addresses: list[str]) -> TakeFeed | EdgeFeed:
    """Returns the take's feed, or the edges' feed."""
    if take is not None:
        from enliven_viewer.link import TakeFeed

        return TakeFeed(take)
    from enliven_viewer.link import EdgeClient, EdgeFeed

    return EdgeFeed(EdgeClient(addresses))


def _parse_addresses(edges: list[str], port: int | None, control_port: int | None) -> list[str]:
    """Returns HOST[:PORT[:CONTROL_PORT]] of the options; separately given ports override those in ``edges``.

    Raises:
        InputError: if an address is invalid, or separate ports are given for several edges.
    """
    from enliven.wire import Endpoint, parse_endpoint

    if len(edges) > 1 and (port or control_port):
        problem, mend = (
            "several edges cannot share one port",
            "Give each edge its own port: --edge HOST:PORT.",
        )
        raise InputError(problem, where="--port", mend=mend)
    endpoint = parse_endpoint(edges[0])
    pose = port or endpoint.pose_port
    control = control_port or (pose + 1 if port else endpoint.control_port)
    return [str(Endpoint(endpoint.host, pose, control)), *(str(parse_endpoint(edge)) for edge in edges[1:])]
