"""Measures how far puppets are from their performers' paths after a minute.

    for result in travels():        # one for each mesh and performance
        print(result)

Some puppets swim, others stand on two or more legs. Their control points are those suggested by `enliven
examples new`. In each key pose, a control point's offset from rest is its joint's offset from the median
position, scaled to the puppet's size. Nothing is therefore tuned to a mesh.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.puppet import KeyPose
from enliven.example_sessions.mesh import fit_mesh
from enliven.example_sessions.tables import MeshTable
from enliven.examples.performer import extract_performer_clip
from enliven.examples.puppet_motion import solve_layer_motion
from enliven.examples.puppet_trajectory import PuppetMotion
from enliven.meshes.files import load_mesh
from enliven.meshes.mesh import Mesh
from enliven.modeling.edits import change_layers
from enliven.modeling.puppet.suggest import suggest_puppet
from enliven.motion_clips.take_files import read_take
from enliven.skeletons.facing import find_facing, rotate_about_y

DATA = Path(os.environ.get("ENLIVEN_DATA", str(Path(__file__).parents[4] / "shared" / "data")))
SECONDS = 60.0
"""Minimum time that each puppet is played, seconds. Its take is looped as often as needed."""
MESHES = {
    "fish": MeshTable("meshes/cinolib/blub_triangulated.obj", 0.8),
    "shark": MeshTable("meshes/partickle/shark.obj", 0.6),
    "manta": MeshTable("gltf/quaternius/Manta_ray.glb", 0.2),
    "octopus": MeshTable("meshes/partickle/octopus.obj", 0.8),
    "spider": MeshTable("gltf/quaternius/Spider.glb", 0.6),
    "cow": MeshTable("meshes/common3d/cow.obj", 1.4, "y", -90.0),
    "horse": MeshTable("gltf/quaternius/Horse.glb", 1.5),
    "cactus": MeshTable("meshes/cinolib/cactus.off", 1.7, "z", 90.0),
    "humanoid": MeshTable("meshes/cinolib/humanoid.off", 1.7),
    "armadillo": MeshTable("meshes/libigl/armadillo.obj", 1.7),
    "trex": MeshTable("meshes/trex/trex_yana.obj", 1.2),
}
STAYS = {
    "traffic": "cmu_expmap/train_directing_traffic_4.txt",
    "waves": "bvh/bandai_namco/dataset-2_wave-both-hands_normal_001.bvh",
}
"""Performances in which the person stays in place."""
GOES = {
    "walks": "cmu_expmap/test_walking_1.txt",
    "strolls": "bvh/bandai_namco/dataset-1_walk_normal_001.bvh",
    "boxes": "bvh/cmu_mirrors/Boxing_Toes.bvh",
    "leaps": "bvh/cmu_mirrors/01_01.bvh",
}
"""Performances in which the person moves to another place."""


@dataclass(frozen=True)
class Travelled:
    """The travel of a puppet.

    Attributes:
        mesh, take: names of :data:`MESHES`, :data:`STAYS` and :data:`GOES`.
        offset: distance on the floor from the performer's scaled path, at the end of the last loop, metres.
        farthest: largest distance on the floor from the performer's scaled path in all frames of the take,
            metres.
        slide: mean sliding speed of anchors over all frames in contact, centimetres per second.
        pairs: the joints of its control points, feet with a star.
    """

    mesh: str
    take: str
    offset: float
    farthest: float
    slide: float
    pairs: str

    def __str__(self) -> str:
        distances = f"{self.offset:.2f} m off, at most {self.farthest:.2f} m"
        return f"{self.mesh:10s} {self.take:8s} {distances}, slides {self.slide:.1f} cm/s: {self.pairs}"


def list_travels() -> Iterator[Travelled]:
    """Yields every mesh in every performance, if their files exist."""
    for mesh, table in MESHES.items():
        for take, file in {**STAYS, **GOES}.items():
            if (DATA / table.file).is_file() and (DATA / file).is_file():
                yield compute_travel(mesh, take)


def compute_travel(mesh: str, take: str) -> Travelled:
    """Returns the travel of a mesh in a performance."""
    project = posed(load_mesh_by_name(mesh), load_clip_by_name(take))
    puppet = project.puppets["it"]
    motion = solve_layer_motion(project, puppet, 0)
    points = [point.joint + "*" * point.foot for point in puppet.points]
    distances = np.linalg.norm((motion.root - motion.root[0] - motion.path)[:, [0, 2]], axis=1)
    offset, farthest = _compute_offset(motion), float(distances.max())
    return Travelled(mesh, take, offset, farthest, slide(motion), ", ".join(points))


def posed(mesh: Mesh, clip: Clip) -> Project:
    """Returns a suggested puppet "it" that plays a clip in a loop, with each point posed like its joint."""
    project = suggest_puppet(Project().with_takes(clip), mesh, clip.id, "it")
    puppet = project.puppets["it"]
    size = np.ptp(mesh.vertices, axis=0).max() / np.ptp(clip.skeleton.positions, axis=0).max()
    took = extract_performer_clip(clip, [point.joint for point in puppet.points])
    seen = rotate_about_y(took.poses, -find_facing(clip.skeleton))
    poses = []
    for pose in puppet.poses:
        places = puppet.rest + size * (seen[round(pose.time / clip.step)] - np.median(seen, axis=0))
        places[:, 1] = np.maximum(places[:, 1], np.minimum(puppet.rest[:, 1], 0.0))
        poses.append(KeyPose(pose.take, pose.time, places))
    project = project.with_characters(replace(puppet, poses=tuple(poses)))
    return change_layers(project, "it", [0], loop=True)


@lru_cache
def load_mesh_by_name(name: str) -> Mesh:
    """Returns one of :data:`MESHES`, upright and scaled."""
    table = MESHES[name]
    return fit_mesh(load_mesh(DATA / table.file)[0], table)


@lru_cache
def load_clip_by_name(name: str) -> Clip:
    """Returns one of :data:`STAYS` or :data:`GOES`."""
    return read_take(DATA / {**STAYS, **GOES}[name])[0]


def slide(motion: PuppetMotion) -> float:
    """Returns the mean sliding speed of anchors over all frames in contact, centimetres per second."""
    world = rotate_about_y(motion.places, motion.yaw[:, None]) + motion.root[:, None]
    frames = np.flatnonzero((motion.anchors[1:] == motion.anchors[:-1]) & (motion.anchors[1:] >= 0))
    anchors = motion.anchors[frames + 1]
    moved = (world[frames + 1, anchors] - world[frames, anchors])[:, [0, 2]]
    return float(np.linalg.norm(moved, axis=1).mean() / motion.step * 100.0) if len(frames) else 0.0


def _compute_offset(motion: PuppetMotion) -> float:
    """Returns the distance from the performer's path, which continues from loop to loop, metres."""
    rounds = int(np.ceil(SECONDS / ((motion.frames - 1) * motion.step))) - 1
    turn, path = float(motion.yaw[-1]), motion.path[-1]
    for _ in range(rounds):
        path = rotate_about_y(path, np.asarray(turn)) + motion.path[-1]
    root = motion.root_at(motion.frames - 1.0, rounds)[1] - motion.root[0]
    return float(np.linalg.norm((root - path)[[0, 2]]))
