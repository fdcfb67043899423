"""enliven view: shows characters on a screen."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.terminal import print_line
from enliven.errors import InputError, ResourceError
from enliven.files import require_folder
from enliven.outputs.settings import LiveOutputSettings, collect_output_settings
from enliven.settings import load_settings
from enliven.supervision.lifetime import terminate_as_interrupt
from enliven_viewer.doctor import has_display
from enliven_viewer.settings import ViewerSettings, WindowStart, with_size

if TYPE_CHECKING:
    from enliven_viewer.link.edge_feed import EdgeFeed
    from enliven_viewer.link.take_feed import TakeFeed

DEFAULT_ADDRESS = "127.0.0.1"


def view(
    take: Annotated[
        Path | None, typer.Argument(help="Play this take instead of the live stream of an edge.")
    ] = None,
    edge: Annotated[
        list[str] | None,
        typer.Option(
            help=f"Address of an edge: HOST or HOST:PORT. Repeat it for several. Default {DEFAULT_ADDRESS}."
        ),
    ] = None,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="The edge's port for poses.")] = None,
    control_port: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65535,
            help="The edge's port for commands. Default: the port after the pose port.",
        ),
    ] = None,
    film: Annotated[Path | None, typer.Option(help="Write this MP4 instead of opening a window.")] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="Write this contact sheet (PNG) instead of opening a window.")
    ] = None,
    size: Annotated[str | None, typer.Option(help="Size of the window or film, such as 1920x1080.")] = None,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="Stop after this number of seconds.")] = None,
    wait: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Seconds to wait for an edge before a film fails. Default: film.patience in the settings.",
        ),
    ] = None,
    hud: Annotated[bool, typer.Option(help="Show text over the picture.")] = True,
    fullscreen: Annotated[
        bool,
        typer.Option(
            "--fullscreen", help="Fill the screen for an audience, without menus. F11 shows the menus."
        ),
    ] = False,
    space: Annotated[
        Path | None,
        typer.Option(help="Space file of enliven calibrate, which places several edges in one space."),
    ] = None,
    out: Annotated[
        list[str] | None,
        typer.Option(
            help="Send the shown motion live to another program: vmc:HOST[:PORT], vrchat:, rokoko: or osc:. "
            "Or let Foxglove connect to this computer: foxglove:127.0.0.1. Repeat the option for several."
        ),
    ] = None,
    settings: Annotated[Path | None, typer.Option(help="A TOML file of settings.")] = None,
) -> None:
    """Watch characters move, live from an edge or from a take, in a window or as a film.

    \b
      enliven view                                 the edge on this machine, or a list of those on the network
      enliven view --edge 192.168.1.20             an edge on the network
      enliven view --edge 10.0.0.5 --edge 10.0.0.6  two edges, side by side
      enliven view --edge 10.0.0.5 --edge 10.0.0.6 --space SPACE.toml  two edges in one calibrated space
      enliven view TAKE.mcap                       play a take: space, arrows, drag the timeline
      enliven view --fullscreen                    for an audience: no menus, no numbers, no keys
      enliven view --fullscreen --no-hud           an installation: the picture alone
      enliven view TAKE.mcap --out vmc:127.0.0.1   stream a take into Unreal, VSeeFace or Blender
      enliven view --film out.mp4 --sheet out.png  no display needed; ends with the edge's stream
      enliven view TAKE.mcap --film out.mp4 --size 1920x1080 --no-hud

    This opens the window of `enliven studio` in its Play workspace. Press H for the keyboard shortcuts.
    """
    chosen_settings = with_size(
        load_settings(ViewerSettings, settings) if settings else ViewerSettings(), size
    )
    if wait is not None:
        chosen_settings = replace(chosen_settings, film=replace(chosen_settings.film, patience=wait))
    require_folder(film, sheet)
    _require_take(take)
    filming = film is not None or sheet is not None
    if space is not None and filming:
        remedy = "Leave out --film and --sheet to open a window."
        raise InputError(
            "a film shows only one edge, so it cannot use a space file", where="--space", remedy=remedy
        )
    if out and filming:
        remedy = (
            "Leave out --film and --sheet to open a window, or export the take to a file: enliven export."
        )
        raise InputError(
            "this option needs a window, but --film and --sheet open none", where="--out", remedy=remedy
        )
    if space is None and chosen_settings.space and settings is not None:
        space = settings.parent / chosen_settings.space
    if not filming and not has_display():
        raise ResourceError(
            "no display was found for the window",
            where="enliven view",
            remedy="Render a film without a window: enliven view --film out.mp4 --sheet out.png",
        )
    addresses = parse_addresses(edge or [DEFAULT_ADDRESS], port, control_port)
    is_address_open = not (edge or port or control_port or take or filming or fullscreen)
    if is_address_open and list_network_edges(addresses[0]):
        addresses = []
    with terminate_as_interrupt():
        if filming:
            _make_film(take, addresses, film, sheet, chosen_settings, seconds, hud)
        else:
            start = WindowStart(_make_title(take), not hud, fullscreen, escape_ends=True, audience=True)
            outputs = (
                collect_output_settings(out or [], chosen_settings.outputs),
                settings and settings.parent,
            )
            _open_window(take, addresses, chosen_settings, seconds, start, space, outputs)


_SEARCH_S = 1.5
"""Seconds to search the network for edges before the window opens. The window continues the search."""


def list_network_edges(local: str) -> bool:
    """Prints the edges on the network if no edge runs on this machine. Returns True if it printed any.

    The caller then opens the window, which lists the same edges with their camera images. A click connects.
    """
    from enliven.peers.announcement import find_missing_discovery_reason
    from enliven.peers.edge_browser import answers_locally, describe_edge, find_edges
    from enliven.wire import parse_endpoint

    if answers_locally(parse_endpoint(local)) or find_missing_discovery_reason():
        return False
    try:
        edges = find_edges(_SEARCH_S)
    except ResourceError:
        return False
    for edge in edges:
        line, remedy = describe_edge(edge)
        print_line(f"{edge.announcement.name}: {line}{f'. {remedy}' if remedy else ''}")
    if edges:
        print_line(
            "enliven: no edge runs on this machine. Choose an edge in the window, or pass --edge ADDRESS."
        )
    return bool(edges)


_OTHER_COMMANDS = {
    ".glb": "Open the file: enliven studio {0}. Or render a film: enliven export {0} -o film.mp4",
    ".enliven": "Open the file: enliven studio {0}",
    ".mp4": "Play the file in a video player",
}
_OTHER_COMMANDS |= dict.fromkeys((".gltf", ".vrm", ".bvh"), _OTHER_COMMANDS[".glb"])
"""Advice for files that are not takes, by file extension."""


def _require_take(take: Path | None) -> None:
    """Raises an InputError with advice if the file type shows that another command must open the file."""
    if take is not None and take.suffix.lower() in _OTHER_COMMANDS and take.exists():
        remedy = _OTHER_COMMANDS[take.suffix.lower()].format(take) + "."
        raise InputError("the file is not a take", where=str(take), remedy=remedy)


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
    from enliven_viewer.film.film import make_film
    from enliven_viewer.playback.document import Document
    from enliven_viewer.playback.timeline import Timeline

    feed = _open_feed(take, addresses)
    document = Document(Timeline(settings.playback, bounded=False))
    with contextlib.closing(feed):
        report = make_film(
            feed, document, film, sheet, settings, seconds=seconds, title=_make_title(take), caption=hud
        )
    written_files = " and ".join(str(path) for path in (film, sheet) if path)
    print_line(f"enliven: wrote {written_files}: {report.pictures} pictures, {report.seconds:.1f} s")


def _open_window(
    take: Path | None,
    addresses: list[str],
    settings: ViewerSettings,
    seconds: float | None,
    opening: WindowStart,
    space: Path | None = None,
    outputs: tuple[Mapping[str, LiveOutputSettings], Path | None] = ({}, None),
) -> None:
    """Opens the window in its Play workspace.

    Args:
        outputs: the live outputs by name, and the folder of the settings file.
    """
    from enliven.outputs.opening import open_outputs
    from enliven.space.space_file import load_space
    from enliven_viewer.studio.editor.editor import Editor
    from enliven_viewer.studio.features.perform.session import PerformSession
    from enliven_viewer.studio.settings import StudioSettings
    from enliven_viewer.studio.window.live_outputs import WindowOutputs
    from enliven_viewer.studio.window.window import StudioWindow
    from enliven_viewer.studio.workspace.workspace import Workspace

    loaded_space = None if space is None else load_space(space)
    studio_settings = StudioSettings(settings.render, settings.width, settings.height)
    workspace = Workspace.new(Editor(studio_settings))
    workspace.tabs.active = "Play" if take is not None or addresses else "Perform"
    perform = workspace.state(PerformSession)
    perform.shared_space.space = loaded_space
    if take is not None:
        perform.follow_take(take, settings.playback)
    else:
        for address in addresses:
            perform.add_secondary(address, settings.playback)
    with WindowOutputs(workspace, open_outputs(*outputs)) as sending:
        StudioWindow(workspace, opening=opening, outputs=sending).run(seconds=seconds)


def _make_title(take: Path | None) -> str:
    return f"enliven · {take.name}" if take else "enliven"


def _open_feed(take: Path | None, addresses: list[str]) -> TakeFeed | EdgeFeed:
    """Returns a feed that reads the take if one is given, otherwise a feed that follows the edges."""
    if take is not None:
        from enliven_viewer.link.take_feed import TakeFeed

        return TakeFeed(take)
    from enliven_viewer.link.edge_client import EdgeClient
    from enliven_viewer.link.edge_feed import EdgeFeed

    return EdgeFeed(EdgeClient(addresses))


def parse_addresses(edges: list[str], port: int | None, control_port: int | None) -> list[str]:
    """Returns the addresses HOST[:PORT[:CONTROL_PORT]] from the options. Ports given as separate options
    override those in ``edges``.

    Raises:
        InputError: if an address is invalid, or separate ports are given for several edges.
    """
    from enliven.wire import Endpoint, parse_endpoint

    if len(edges) > 1 and (port or control_port):
        problem, remedy = (
            "several edges cannot share one port",
            "Pass the port of each edge: --edge HOST:PORT.",
        )
        raise InputError(problem, where="--port", remedy=remedy)
    endpoint = parse_endpoint(edges[0])
    pose = port or endpoint.pose_port
    control = control_port or (pose + 1 if port else endpoint.control_port)
    return [str(Endpoint(endpoint.host, pose, control)), *(str(parse_endpoint(edge)) for edge in edges[1:])]
