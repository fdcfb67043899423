"""Quality measures of a puppet: key pose error, sliding, volume, intersecting faces, jitter, times."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from example_play import Shot

from enliven.arrays import Float
from enliven.deformation.arap.self_intersection import SelfIntersection
from enliven.document.project import Project
from enliven.document.puppet import ExampleCharacter
from enliven.examples.performer import extract_performer_clip
from enliven.examples.puppet_motion import solve_layer_motion
from enliven.examples.puppet_trajectory import PuppetMotion
from enliven.meshes.mesh import Mesh, weld

_EVERY = 10
"""Volume and intersecting faces are measured in every tenth frame."""


@dataclass(frozen=True)
class Measures:
    """The measurements.

    Attributes:
        solve_s: seconds for the trajectories and the locomotion of the whole take.
        surface_ms: median milliseconds of the surface per frame.
        missed_mm: largest distance of a control point from its key pose at the key pose's time.
        slide_mm: largest distance that an anchor slides over the floor, also between frames.
        volume: (2,) minimum and maximum, relative to the volume at rest. NaN for an open mesh.
        crossing: (2,) fraction of faces that intersect but do not at rest: mean and maximum.
        jitter: root mean square acceleration of the control points relative to the performer's, each
            relative to its size.
        hands: correlation of the heights of hands and the points paired with them; NaN without such
            points.
    """

    solve_s: float
    surface_ms: float
    missed_mm: float
    slide_mm: float
    volume: tuple[float, float]
    crossing: tuple[float, float]
    jitter: float
    hands: float

    def __str__(self) -> str:
        parts = [
            f"solved in {self.solve_s:.3f} s, surface {self.surface_ms:.1f} ms a picture",
            f"key poses missed by {self.missed_mm:.1f} mm at most, the anchor slides {self.slide_mm:.3f} mm",
            f"volume {self.volume[0]:.2f}..{self.volume[1]:.2f}",
            f"crossing faces {100 * self.crossing[0]:.2f} % (most {100 * self.crossing[1]:.2f} %)",
            f"jitter {self.jitter:.2f}, hands {self.hands:.2f}",
        ]
        return "; ".join(parts)


class Ruler:
    """Measures a film shot by shot. It stores only numbers, because surfaces are large."""

    def __init__(self, project: Project) -> None:
        self._project, self._puppet = project, next(iter(project.puppets.values()))
        self._times: list[float] = []
        self._volumes: list[tuple[float, float]] = []
        self._crossings: list[float] = []
        self._asked = SelfIntersection(self._puppet.mesh)

    def see(self, shot: Shot) -> None:
        """Adds a shot."""
        if len(self._times) % _EVERY == 0:
            self._volumes.append(volumes(self._puppet.mesh, [shot.local]))
            faces = self._asked.find_new_crossing_faces(shot.local)
            self._crossings.append(len(faces) / len(self._puppet.mesh.faces))
        self._times.append(shot.solve_ms)

    def measures(self) -> Measures:
        """Returns the measurements."""
        project, puppet = self._project, self._puppet
        begun = time.perf_counter()
        motion = solve_layer_motion(_copy_project(project, puppet), puppet, 0)
        return Measures(
            time.perf_counter() - begun,
            float(np.median(self._times[1:])),
            1000.0 * missed(puppet, motion),
            1000.0 * slide(motion),
            (min(low for low, _ in self._volumes), max(high for _, high in self._volumes)),
            (float(np.mean(self._crossings)), max(self._crossings)),
            jitter(project, puppet, motion),
            hands(project, puppet, motion),
        )


def missed(puppet: ExampleCharacter, motion: PuppetMotion) -> float:
    """Returns the largest distance from key poses at their times, metres. Planted feet are excluded, because
    they are moved.
    """
    kept = [k for k, point in enumerate(puppet.points) if not (point.foot and puppet.locomotion.plant)]
    frames = [round(pose.time / motion.step) for pose in puppet.poses]
    away = [(motion.places[f] - pose.places)[kept] for f, pose in zip(frames, puppet.poses, strict=True)]
    return float(np.linalg.norm(away, axis=2).max())


def slide(motion: PuppetMotion, parts: int = 4) -> float:
    """Returns the largest distance that an anchor moves over the floor during its contact, metres."""
    most = 0.0
    changes = np.flatnonzero(np.diff(motion.anchors)) + 1
    for frames in np.split(np.arange(motion.frames), changes):
        anchor = int(motion.anchors[frames[0]])
        if anchor < 0 or len(frames) < 2:
            continue
        times = np.linspace(frames[0], frames[-1], parts * (len(frames) - 1) + 1)
        stood = np.array([_find_position(motion, frame, anchor) for frame in times])
        most = max(most, float(np.linalg.norm((stood - stood[0])[:, [0, 2]], axis=1).max()))
    return most


def volumes(mesh: Mesh, surfaces: list[Float]) -> tuple[float, float]:
    """Returns the minimum and maximum volume relative to rest, NaN if the welded mesh is not closed."""
    welded, of = weld(mesh)
    faces = of[mesh.faces]
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
    if (np.unique(edges, axis=0, return_counts=True)[1] != 2).any() or np.ptp(
        welded.vertices, axis=0
    ).min() == 0:
        return float("nan"), float("nan")
    all_of = [_compute_volume(surface, mesh) for surface in surfaces]
    rest = _compute_volume(mesh.vertices, mesh)
    return min(all_of) / rest, max(all_of) / rest


def crossings(mesh: Mesh, surfaces: list[Float]) -> tuple[float, float]:
    """Returns the mean and maximum fraction of faces that intersect but do not at rest."""
    asked = SelfIntersection(mesh)
    crossed = np.array([len(asked.find_new_crossing_faces(surface)) for surface in surfaces]) / len(
        mesh.faces
    )
    return float(crossed.mean()), float(crossed.max())


def jitter(project: Project, puppet: ExampleCharacter, motion: PuppetMotion) -> float:
    """Returns the acceleration of control points relative to that of their joints, each relative to its
    size."""
    poses = extract_performer_clip(
        project.takes[puppet.layers[0].take], [point.joint for point in puppet.points]
    ).poses
    moves = [_measure_suddenness(motion.places), _measure_suddenness(poses)]
    return moves[0] / moves[1]


def hands(project: Project, puppet: ExampleCharacter, motion: PuppetMotion) -> float:
    """Returns the correlation of the heights of hands and of the points paired with them, the lowest of all
    pairs."""
    rows = [k for k, point in enumerate(puppet.points) if point.joint.endswith(("Hand", "Wrist"))]
    if not rows:
        return float("nan")
    poses = extract_performer_clip(
        project.takes[puppet.layers[0].take], [point.joint for point in puppet.points]
    ).poses
    return min(float(np.corrcoef(poses[5:, k, 1], motion.places[5:, k, 1])[0, 1]) for k in rows)


def _copy_project(project: Project, puppet: ExampleCharacter) -> Project:
    """Returns the project with copies of its takes, so that no cached results are used. Plays it once to warm
    up.
    """
    solve_layer_motion(project, puppet, 0)
    return replace(project, takes={name: replace(take) for name, take in project.takes.items()})


def _find_position(motion: PuppetMotion, frame: float, point: int) -> Float:
    """Returns (3,) position of a control point in the world, metres."""
    yaw, root = motion.root_at(frame)
    x, y, z = motion.places_at(frame)[point]
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([cos * x + sin * z, y, cos * z - sin * x]) + root


def _measure_suddenness(places: Float) -> float:
    """Returns the root mean square second difference of (F, P, 3) from frame 5 on, relative to the extent of
    the motion."""
    moves = places[5:] - places[5:].mean(0)
    return float(np.sqrt((np.diff(moves, 2, axis=0) ** 2).mean() / (moves**2).mean()))


def _compute_volume(vertices: Float, mesh: Mesh) -> float:
    a, b, c = (vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)
