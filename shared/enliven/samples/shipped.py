"""Reads the sample characters, which are stored next to this file and made by scripts/make_samples.py."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.rotation import slerp

if TYPE_CHECKING:
    from enliven.document import Project

SAMPLES_FOLDER = Path(__file__).resolve().parent
"""The folder of the sample files."""
_BEAT_FRAMES = 18
"""Number of frames from one pose of the dance to the next. It is 0.6 s, the tempo of a slow march."""
_FRAME_S = 1.0 / 30.0
"""Duration of a frame of the dance, seconds."""
COORDINATE_STEP_M = 2.0**-14
"""Quantization step of a coordinate in the files, metres (0.06 mm). It is 1/200 of the length of an edge."""


_OWN_PARTS = {"lamp": "hip and right arm"}
"""The body parts that attach to a sample by default. For other meshes, all parts are
used."""


def default_parts(mesh: str) -> str:
    """Returns the body parts that attach to a mesh by default. They depend on the name or path of the
    mesh."""
    return _OWN_PARTS.get(mesh, "all")


def load_sample(name: Literal["chair", "lamp", "cactus"]) -> Mesh:
    """Returns a sample mesh with coloured vertices that stands on y = 0, in metres.

    chair: an armchair 1.75 m tall, one closed surface, that faces +Z. A person standing at the origin has the
    legs in its back legs, the spine in its back, and the forearms, held forward, in its armrests.

    lamp: a sprung desk lamp 1.7 m tall, eighteen closed shells, that reaches to the right. A person standing
    at the origin and facing +Z, with the right arm stretched out, has hip and arm in its lower and upper arm.

    cactus: a saguaro 1.3 m tall in a pot, with two arms and two eyes. It is symmetric about the plane x = 0.

    Raises:
        InputError: if the name is unknown.
    """
    if name == "cactus":
        return cactus_project().puppet(name).mesh
    if not (SAMPLES_FOLDER / f"{name}.npz").is_file():
        raise InputError(
            f"the sample {name!r} does not exist",
            where="samples",
            remedy="Known samples: chair, lamp, cactus.",
        )
    with np.load(SAMPLES_FOLDER / f"{name}.npz") as stored:
        steps, faces = (stored[key].cumsum(1, np.int32).T for key in ("vertices", "faces"))
        return Mesh(steps * COORDINATE_STEP_M, faces, name, stored["colours"])


def cactus_project() -> Project:
    """Returns a project with the cactus as a puppet that a tracked person moves.

    The project also contains the take of the puppet's key poses. The performer's poses are constructed from
    bone directions. They are not recordings.
    """
    from enliven.formats.project.file import read_project

    return read_project(SAMPLES_FOLDER / "cactus.enliven")


def dancing_cactus() -> Project:
    """Returns the project of the cactus with a looped dance: one beat from each key pose to the next."""
    from enliven.document import Clip, PuppetLayer

    project = cactus_project()
    puppet = project.puppet("cactus")
    poses = project.takes[puppet.poses[0].take]
    fractions = np.arange(_BEAT_FRAMES) / _BEAT_FRAMES
    fractions = fractions * fractions * (3.0 - 2.0 * fractions)
    next_pose = np.roll(np.arange(len(poses.turns)), -1)
    turns = slerp(poses.turns[:, None], poses.turns[next_pose, None], fractions[None, :, None])
    places = poses.root[:, None] + fractions[None, :, None] * (poses.root[next_pose] - poses.root)[:, None]
    turns, root = turns.reshape(-1, *poses.turns.shape[1:]), places.reshape(-1, 3)
    # End the dance in its first pose, so that it can be looped.
    turns, root = np.concatenate([turns, poses.turns[:1]]), np.concatenate([root, poses.root[:1]])
    dance = Clip("cactus dance", poses.skeleton, turns, root, _FRAME_S)
    layer = PuppetLayer(dance.id, loop=True, travel=False)
    return project.with_takes(dance).with_characters(puppet.with_changes(layers=(layer,)))
