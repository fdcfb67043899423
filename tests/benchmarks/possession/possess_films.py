"""Films of meshes that real people possess, written to out/possess, with measurements of each.

    python tests/benchmarks/possession/possess_films.py                all films
    python tests/benchmarks/possession/possess_films.py horse lamp     films with one of the words in the name
    python tests/benchmarks/possession/possess_films.py --sheets       contact sheets only: much quicker

The skeleton that drives the mesh stands inside it while it is attached, and then moves to its side. If the
recordings of ENLIVEN_DATA are missing, the project's own performer drives the chair and the lamp.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2] / "helpers"))

sys.path.insert(0, str(Path(__file__).parents[3] / "scripts"))

from known_bodies import BODIES
from possess_cast import (
    actor_of,
    cut,
    load_shared_mesh,
    make_dance,
    repeat_body,
    retarget_to_person,
    scan_in_world,
)
from possess_measures import measure
from possess_studio import Studio
from possess_take import Act, perform
from turning_measures import NOISE_M
from turning_people import FRAME_RATE_HZ, spinning_people

from enliven.deformation.constraints.floor_contact import FloorSettings
from enliven.frames import BodyFrame
from enliven.meshes.mesh import Mesh
from enliven.possession import ActorSettings, EmbeddedActor
from enliven_edge.importing.mirror import mirror_frames
from enliven_edge.importing.registry import find_files, find_reader
from enliven_edge.stage.character_setup import create_actor, create_mesh_actor

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data"))
OUT = Path(__file__).parents[3] / "out" / "possess"


@dataclass(frozen=True)
class Film:
    """A mesh, its performers, and their attachment.

    Attributes:
        title: text in the image.
        made: function that returns the body frames and the actor.
        acts: the times of attachment, and the performers.
    """

    title: str
    made: Callable[[], tuple[list[BodyFrame], EmbeddedActor]]
    acts: tuple[Act, ...]


def read(pattern: str) -> list[BodyFrame]:
    """Reads a recording of joints with the reader for its format."""
    paths = find_files([str(DATA / pattern)])
    return [frame for frame in find_reader(paths).read(paths) if isinstance(frame, BodyFrame)]


LIFT, TWO = "skeletons/js6450_kinect2_json/1person_lift*", "skeletons/kinect_multitrack/Study_24*"
WING, WAVE = (f"skeletons/ms_labanotation_kinect2/Ges0{name}*" for name in ("6", "1"))
RAISED = ActorSettings(floor=FloorSettings(use="raised"))
"""Wooden legs cannot bend when they would sink into the floor, so the mesh is lifted instead."""
STROLL = "bvh/bandai_namco/dataset-1_walk_musical_001.bvh"
HORSE = "meshes/libigl/horse_quad.obj"
CHAIR = "gltf/quaternius_static/house_interior_pack_Chair_1.glb"
SCAN = "scans/bodyscanner_kinect2/20190823_020756"
TRUNK = "legs + torso"


def list_real_films() -> dict[str, Film]:
    """Returns, by name, the films that need the real recordings."""
    wide = replace(RAISED, enough=0.7)
    return {
        "chair": Film(
            "The chair, by a Kinect's skeleton", _load_mesh_and_recording("chair", LIFT), (Act(0.45),)
        ),
        # It starts when the feet pass each other. In mid-stride, a person's legs do not match a chair's legs.
        "chair-walk": Film(
            "The chair walks, by motion capture",
            _load_mesh_and_recording("chair", STROLL, (0.6, 9.0)),
            (Act(0.0, TRUNK),),
        ),
        # The chair's legs are farther apart than a person's, so more points of each leg's bones must be
        # attached.
        "real-chair": Film(
            "A chair from a game", _load_mesh_and_recording(CHAIR, LIFT, settings=wide), (Act(0.45, TRUNK),)
        ),
        "horse": Film(
            "A horse, by one Kinect's skeleton", _load_mesh_and_recording(HORSE, LIFT), (Act(0.45, TRUNK),)
        ),
        # The sensor placed this person's right arm inside their thigh, so that arm is not attached.
        "scan": Film(
            "Half a scan of a person, by their own joints", _scan, (Act(0.6, f"{TRUNK} + left arm"),)
        ),
        "two-on-a-horse": Film(
            "Two people, one horse", _make_two_people, (Act(0.4, TRUNK, 0), Act(0.8, TRUNK, 1, "join"))
        ),
        "t-pose": Film(
            "A T-posed woman comes to her performer's pose", _load_stepped_into(WAVE), (Act(1.3),)
        ),
        "t-pose-before": Film(
            "A T-posed woman, held where bones are near", _load_stepped_into(WAVE, meets=False), (Act(1.3),)
        ),
        "lamp": Film(
            "The lamp, by hip and right arm", _load_mesh_and_recording("lamp", WAVE), (Act(1.3, LAMP_PARTS),)
        ),
        "lamp-wing": Film(
            "The lamp, by hip and right arm", _load_mesh_and_recording("lamp", WING), (Act(2.2, LAMP_PARTS),)
        ),
    }


LAMP_PARTS = "hip and right arm"


def films() -> dict[str, Film]:
    """Returns, by name, the films that can be made on this machine."""
    own_films = {
        "made-chair": Film(
            "The chair, by the project's own performer", _create_own_mesh("chair", "chair"), (Act(1.0),)
        ),
        "woman-turns": Film("A woman, mapped, while her performer turns", _load_mapped_woman(1), (Act(2.5),)),
        "woman-turns-again": Film(
            "A woman, mapped, by another performer who turns", _load_mapped_woman(2), (Act(2.5),)
        ),
        "made-lamp": Film(
            "The lamp, by the project's own performer",
            _create_own_mesh("lamp", "overhead"),
            (Act(1.65, LAMP_PARTS),),
        ),
    }
    return {**(list_real_films() if DATA.is_dir() else {}), **own_films}


def _load_mesh_and_recording(
    mesh: str,
    recording: str,
    piece: tuple[float, float] | None = None,
    settings: ActorSettings = RAISED,
) -> Callable[[], tuple[list[BodyFrame], EmbeddedActor]]:
    """Returns a function that loads a mesh by name or file, and a recording or a part of it."""

    def made() -> tuple[list[BodyFrame], EmbeddedActor]:
        frames = read(recording)
        spec = mesh if "/" not in mesh else str(DATA / mesh)
        return cut(frames, piece or (0.0, 1e9)), create_actor(spec, settings=settings)

    return made


def _load_stepped_into(
    recording: str, meets: bool = True
) -> Callable[[], tuple[list[BodyFrame], EmbeddedActor]]:
    """Returns a function that loads a woman of the project's ten bodies in a T-pose, and a recording of
    another pose."""

    def made() -> tuple[list[BodyFrame], EmbeddedActor]:
        mesh = BODIES["t woman"]().mesh
        return read(recording), create_mesh_actor(mesh, "woman", settings=replace(RAISED, meets=meets))

    return made


def _load_mapped_woman(seed: int) -> Callable[[], tuple[list[BodyFrame], EmbeddedActor]]:
    """Returns a function that loads a woman of the project's ten bodies, and a person who turns both ways."""

    def made() -> tuple[list[BodyFrame], EmbeddedActor]:
        people = spinning_people(seed, noise_m=NOISE_M)
        frames = [
            BodyFrame([body], round(n * 1e9 / FRAME_RATE_HZ), "performer") for n, body in enumerate(people)
        ]
        mesh = BODIES["t woman"]().mesh
        return frames, create_mesh_actor(mesh, "woman", settings=ActorSettings(how="mapped", travel=1.0))

    return made


def _create_own_mesh(mesh: str, moves: str) -> Callable[[], tuple[list[BodyFrame], EmbeddedActor]]:
    """Returns a function that creates one of the project's own meshes, and its synthetic performer."""
    return lambda: (make_dance(moves), create_actor(mesh, settings=RAISED))


def _scan() -> tuple[list[BodyFrame], EmbeddedActor]:
    """Returns the person's own joints for a moment, then other people's motions retargeted to this person."""
    own = read(f"{SCAN}.csv")[0].bodies[0]
    frames = repeat_body(own, 1.2)
    for other in (
        read(WING),
        [frame for frame in mirror_frames(iter(read(WAVE))) if isinstance(frame, BodyFrame)],
    ):
        frames += retarget_to_person(own, other, frames[-1].time_ns + 33_333_333)
    mesh = scan_in_world(DATA / f"{SCAN}.pcd", DATA / f"{SCAN}.csv", own)
    return frames, actor_of(Mesh(mesh.vertices, mesh.faces, "scan"))


def _make_two_people() -> tuple[list[BodyFrame], EmbeddedActor]:
    """Returns two people next to each other, who walk one after the other, and a horse that both possess."""
    frames = cut(read(TWO), (1.2, 7.9), (17.2, 26.6))
    bodies = sorted(frames[0].bodies, key=lambda body: body.id)
    mesh = load_shared_mesh(DATA / HORSE, bodies)
    return frames, actor_of(replace(mesh, name="horse"), settings=RAISED)


def main(words: list[str]) -> int:
    sheets = "--sheets" in words
    words = [word for word in words if not word.startswith("--")]
    studio = Studio()
    for name, film in films().items():
        if words and not any(word in name for word in words):
            continue
        frames, actor = film.made()
        take = perform(frames, actor, film.acts)
        print(f"{name}: {len(frames)} frames; {measure(take)}", flush=True)
        path = OUT / name
        if sheets:
            studio.sheet(take, path, film.title)
        else:
            studio.film(take, path, film.title)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
