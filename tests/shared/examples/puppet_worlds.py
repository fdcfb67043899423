"""Puppets for tests: a walking performer, a stool with control points, and key poses of the stool."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from enliven.document.clip import Clip
from enliven.document.constraints import Coupling, Position, Velocity
from enliven.document.example_settings import ExampleSettings
from enliven.document.locomotion import LocomotionSettings, Switch
from enliven.document.pin import ContactSettings
from enliven.document.project import Project
from enliven.document.puppet import Plane
from enliven.document.skeleton import Skeleton
from enliven.document.surface_settings import ArapSettings
from enliven.example_sessions.text import write_session
from enliven.meshes.mesh import Mesh
from enliven.modeling.edits import remove_layer
from enliven.modeling.puppet.edits import make_puppet, play_take
from enliven.modeling.puppet.points import add_point, change_point
from enliven.modeling.puppet.poses import add_key_pose, set_symmetry
from enliven.rotation import from_rotation_vector, multiply, rotate

STEP = 1.0 / 30.0
JOINTS = ("Hips", "LeftFoot", "RightFoot", "Spine", "LeftHand", "RightHand", "Head")
PARENTS = (-1, 0, 0, 0, 3, 3, 3)
REST = np.array(
    [[0, 1, 0], [0.1, 0, 0], [-0.1, 0, 0], [0, 1.4, 0], [0.7, 1.4, 0], [-0.7, 1.4, 0], [0, 1.75, 0]]
)
PAIRS = (
    ("left foot", "LeftFoot", True),
    ("right foot", "RightFoot", True),
    ("left hand", "LeftHand", False),
    ("right hand", "RightHand", False),
    ("top", "Head", False),
)
SIDES = Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def walker(
    steps: int = 3,
    id: str = "walk",
    names: tuple[str, ...] = JOINTS,
    size: float = 1.0,
    turning: float = 0.4,
    swing: float = 0.45,
) -> Clip:
    """Returns a person that walks double steps of one second each while turning. The stance foot stands
    still.
    """
    frames = round(steps / STEP) + 1
    t = np.arange(frames) * STEP
    leg = swing * np.sin(2 * np.pi * t)
    turns = np.zeros((frames, len(names), 4))
    turns[..., 0] = 1.0
    heading = from_rotation_vector(np.stack([0 * t, turning * t, 0 * t], 1))
    for joint, (amount, axis) in enumerate(
        [(0, 0), (1.0, 0), (-1.0, 0), (0.1, 2), (0.9, 2), (0.8, 2), (0.3, 0)]
    ):
        vector = np.zeros((frames, 3))
        phase = leg if joint < 3 else swing * np.sin(2 * np.pi * t + joint)
        vector[:, axis] = amount * phase
        turns[:, joint] = multiply(heading, from_rotation_vector(vector))
    skeleton = Skeleton(names, np.array(PARENTS, np.int32), REST * size)
    feet = np.stack([rotate(turns[:, j], skeleton.vectors[j]) for j in (1, 2)], 1)
    root = np.zeros((frames, 3))
    for f in range(1, frames):
        moved = feet[f] - feet[f - 1]
        ahead = rotate(heading[f], np.array([0.0, 0.0, 1.0]))
        root[f] = root[f - 1] - moved[int((moved @ ahead).argmin())]
    root[:, 1] = -feet[:, :, 1].min(1)
    return Clip(id, skeleton, turns, root, STEP)


def stool() -> Mesh:
    """Returns a box that stands on the floor: 1 m tall, 0.6 m wide, 0.4 m deep, with 9 x 9 x 9 cells."""
    n = 10
    grid = np.linspace(0, 1, n)
    index: dict[tuple[int, int, int], int] = {}
    vertices, faces = list[list[float]](), list[list[int]]()

    def number(cell):
        if cell not in index:
            index[cell] = len(vertices)
            vertices.append([(grid[cell[0]] - 0.5) * 0.6, grid[cell[1]], (grid[cell[2]] - 0.5) * 0.4])
        return index[cell]

    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, n - 1):
            for a in range(n - 1):
                for b in range(n - 1):
                    corners = []
                    for da, db in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        cell = [0, 0, 0]
                        cell[axis], cell[u], cell[v] = side, a + da, b + db
                        corners.append(number(tuple(cell)))
                    if side == 0:
                        corners.reverse()
                    faces += [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
    return Mesh(np.array(vertices), np.array(faces), "stool")


def nearest(mesh: Mesh, place) -> int:
    return int(np.linalg.norm(mesh.vertices - place, axis=1).argmin())


def places_for(rest, seed: int, size: float = 0.1):
    return rest + size * np.random.default_rng(seed).normal(size=rest.shape)


def puppet_project(
    seed: int = 0, poses: int = 4, clip: Clip | None = None, play: bool = True, **layer: object
) -> Project:
    """Returns a walking stool with control points at its feet, sides and top, in random key poses."""
    clip = clip or walker()
    mesh = stool()
    project = make_puppet(Project().with_takes(clip), mesh, "stool")
    at = [[0.3, 0, 0.2], [-0.3, 0, 0.2], [0.3, 0.6, 0], [-0.3, 0.6, 0], [0, 1, 0]]
    for (name, joint, foot), place in zip(PAIRS, at, strict=True):
        project = add_point(project, "stool", nearest(mesh, place), name, joint, foot)
    rest = project.puppets["stool"].rest
    last = len(clip.turns) - 1
    for number in range(poses):
        frame = round(number * 0.29 / STEP) % last
        project = add_key_pose(project, "stool", clip.id, frame * STEP, places_for(rest, seed + number))
    return play_take(project, "stool", clip.id, **layer) if play else project


def full_project(seed: int = 0) -> Project:
    """Returns a puppet with every optional element."""
    asked = {
        "positions": (Position("top", 9, (0.0, 1.1, 0.0)), Position("left foot", 2, (0.1, 0.0, 0.3), "x")),
        "velocities": (Velocity("top", 20, (0.1, 0.0, 0.0), "x"),),
        "couplings": (Coupling("top", "left hand", 30, "y", (0.0, 0.4, 0.0)),),
        "switches": (Switch(0, "contact"), Switch(40, "flight")),
    }
    project = puppet_project(seed, **asked)
    project = play_take(
        project.with_takes(walker(1, "short")), "stool", "short", points=("top",), offset=0.25, speed=-0.5,
        loop=True, weight=0.3, muted=True, travel=False, level_feet=False, mirrored=True,
    )  # fmt: skip
    project = set_symmetry(change_point(project, "stool", "top", weight=0.7), "stool", SIDES)
    puppet = project.puppets["stool"].with_changes(
        place=np.array([1.0, 0.0, -1 / 3]),
        turn=np.array([np.cos(0.3), 0.0, np.sin(0.3), 0.0]),
        surface=ArapSettings(iterations=5, hold=0.1),
        examples=ExampleSettings(nearest=3, margin=0.1),
        locomotion=LocomotionSettings(ContactSettings(height=0.2), landing="free"),
    )
    return project.with_characters(puppet)


def full_session(path: Path, loose: bool = False) -> Project:
    """Returns a session file of the full project. ``loose`` leaves out its muted layer."""
    project = full_project()
    if loose:
        project = remove_layer(project, "stool", 1)
    write_session(path, project, "stool")
    return project
