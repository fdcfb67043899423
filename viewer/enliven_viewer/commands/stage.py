"""enliven stage: lists the characters on the stage of a running edge, adds and removes them."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from enliven.commands.terminal import print_line
from enliven.errors import InputError, ResourceError

if TYPE_CHECKING:
    from enliven.document import Project
    from enliven.meshes import Axis
    from enliven.wire import Answer
    from enliven_viewer.link.edge_client import EdgeClient
    from enliven_viewer.link.received_data import ReceivedCues

_ANSWER_TIMEOUT_S = 5.0
"""Timeout in seconds for an edge to answer and to send its characters. It is long enough for slow networks.
"""
_PREPARATION_TIMEOUT_S = 600.0
"""Timeout in seconds for an edge to prepare a character, including a first compilation of its kernels."""
_POLL_INTERVAL_S = 0.005
"""Seconds between two polls of the sockets. A frame takes 33 ms."""

stage = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
Edge = Annotated[str, typer.Option(help="Address of the edge: HOST, or HOST:PORT.")]


@stage.callback()
def _stage() -> None:
    """Put characters on the stage of a running edge, replace or remove them.

    \b
      enliven stage list
      enliven stage put HORSE.obj --edge 192.168.1.20
      enliven stage put SPIDER.glb --drive skeleton --name spider
      enliven stage remove horse
    """


@stage.command()
def put(
    character: Annotated[
        str,
        typer.Argument(
            help="A mesh file, 'chair', 'lamp', a project or a session. FILE#NAME selects one character."
        ),
    ],
    edge: Edge = "127.0.0.1",
    name: Annotated[
        str, typer.Option(help="Name of the character on the stage. Default: the name of the file.")
    ] = "",
    drive: Annotated[
        Literal["graph", "skeleton"],
        typer.Option(help="Deform the mesh with a deformation graph, or with the skeleton of a glTF file."),
    ] = "graph",
    up: Annotated[
        Literal["x", "y", "z"] | None,
        typer.Option(help="Axis of the mesh that points up. Default: detected automatically."),
    ] = None,
) -> None:
    """Put a character on the stage. A character with the same name is replaced, and its performers keep
    control.

    \b
      enliven stage put HORSE.obj
      enliven stage put SHOW.enliven#wolf --edge 192.168.1.20
    """
    project, default_name, scales_to_person = read_character(character, drive, up)
    with _connect(edge) as client:
        is_replacing = (name or default_name) in client.characters
        answers: list[Answer] = []
        client.stage.put(project, default_name, name=name, fit=scales_to_person, then=answers.append)
        _poll_until(client, lambda: answers, _PREPARATION_TIMEOUT_S)
        _require_done(answers, character)
    state_text = "was replaced" if is_replacing else "is now"
    print_line(f"enliven: {name or default_name} {state_text} on the stage of {edge}")


@stage.command()
def remove(
    character: Annotated[str, typer.Argument(help="Name of the character on the stage.")],
    edge: Edge = "127.0.0.1",
) -> None:
    """Remove a character from the stage and release its performers."""
    with _connect(edge) as client:
        answers: list[Answer] = []
        client.stage.remove(character, answers.append)
        _poll_until(client, lambda: answers, _ANSWER_TIMEOUT_S)
        _require_done(answers, character)
    print_line(f"enliven: {character} was removed from the stage of {edge}")


@stage.command("list")
def list_(edge: Edge = "127.0.0.1") -> None:
    """List the characters on the stage: name, revision, kind, vertices, and performers."""
    from enliven.wire import CUES

    kind_labels = {"graph": "a possessed mesh", "bones": "a rigged model", "points": "a puppet"}
    with _connect(edge) as client:
        cues = client.latest(CUES)
        for name, character in client.characters.items():
            holders = _describe_holders(cues.get(name))
            description = f"{kind_labels[character.kind]}, {len(character.vertices)} vertices{holders}"
            print_line(f"{name}: revision {client.edges[0].revision(name)}, {description}")
        if not client.characters:
            print_line("enliven: the stage is empty")


def _describe_holders(cues: ReceivedCues | None) -> str:
    """Returns a text that lists the performers who control a character."""
    if cues is None or cues.state != "possessed":
        return ""
    owners = {int(owner) for owner in cues.owners[: cues.held]} or {cues.body}
    return f", controlled by performers {', '.join(map(str, sorted(owners)))}"


def read_character(spec: str, drive: str, up: Axis | None) -> tuple[Project, str, bool]:
    """Returns (project, id of the character in it, True if the character is to be scaled to a person's
    height).
    """
    from enliven.document import Project
    from enliven.formats.project.one_character import project_of_mesh

    file, _, character_id = spec.partition("#")
    path = Path(file)
    if spec in ("chair", "lamp"):
        from enliven.samples.shipped import load_sample

        return project_of_mesh(load_sample(spec), spec), spec, False
    if path.suffix.lower() in (".enliven", ".toml"):
        return _read_project_character(path, character_id)
    if drive == "skeleton":
        from enliven.formats.gltf.read import read_gltf

        rig = read_gltf(path, floor=True)
        for note in rig.notes:
            print_line(f"enliven: {note}", err=True)
        return Project().with_characters(rig.shape), rig.shape.id, False
    from enliven.meshes import load_upright

    mesh, notes = load_upright(path, up)
    for note in notes:
        print_line(f"enliven: {note}", err=True)
    return project_of_mesh(mesh, path.stem), path.stem, True


def _read_project_character(path: Path, character_id: str) -> tuple[Project, str, bool]:
    """Returns (project, character id, scaling flag) for a named character in a file. An empty id selects the
    only character of a project, or the puppet of a session.
    """
    from enliven.example_sessions.session import read_session
    from enliven.formats.project.file import read_project

    if path.suffix.lower() == ".toml":
        session = read_session(path)
        return session.project, character_id or session.puppet, False
    project = read_project(path)
    if not character_id and len(project.characters) != 1:
        names = ", ".join(f"{path.name}#{id}" for id in project.characters)
        problem = f"the project has {len(project.characters)} characters, so one must be named"
        raise InputError(
            problem,
            where=str(path),
            remedy=f"Pass one of: {names}." if names else "Add a character in enliven studio.",
        )
    return project, character_id or next(iter(project.characters)), False


@contextlib.contextmanager
def _connect(edge: str) -> Iterator[EdgeClient]:
    """Yields the client of an edge after the edge has sent the characters on its stage."""
    from enliven_viewer.link.edge_client import EdgeClient

    client = EdgeClient([edge], "enliven stage")
    with contextlib.closing(client):
        _poll_until(client, lambda: client.edges[0].has_all_characters, _ANSWER_TIMEOUT_S)
        if client.status is None:
            remedy = "Start one with 'enliven edge', or pass its address with --edge."
            raise ResourceError("no edge answers", where=edge, remedy=remedy)
        yield client


def _poll_until(client: EdgeClient, is_done: Callable[[], object], seconds: float) -> None:
    """Polls the link until a condition is true, or for at most ``seconds``."""
    end = time.monotonic() + seconds
    while not is_done() and time.monotonic() < end:
        client.poll()
        time.sleep(_POLL_INTERVAL_S)


def _require_done(answers: list[Answer], address: str) -> None:
    from enliven.wire import Done, Refused

    if answers and isinstance(answers[0], Done):
        return
    reason = answers[0].reason if answers and isinstance(answers[0], Refused) else "the edge does not answer"
    raise InputError(reason.rstrip("."), where=address)
