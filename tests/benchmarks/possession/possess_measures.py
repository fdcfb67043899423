"""Quality measures of a mesh in a take: stretch, inverted triangles, volume, gaps between shells, jumps,
floor penetration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from possess_take import Take
from scipy.spatial import cKDTree
from skinned_normals import skin_normals

from enliven.arrays import Float, Int
from enliven.deformation.skinning import skin_vertices
from enliven.document.character import Character
from enliven.meshes.kernels import shells
from enliven.meshes.mesh import Mesh, weld

_TOUCHING = 0.02
"""Shells closer than this, metres at a height of 1.75 m, are taken to be connected."""
_SECONDS_OF_HOLD = 0.7


@dataclass(frozen=True)
class Measures:
    """The measurements, of the worst frame unless stated otherwise.

    Attributes:
        stretch_95, stretch_100: edge length relative to rest: 95th percentile and maximum.
        squeeze_5: edge length relative to rest: 5th percentile.
        inverted: fraction of triangles whose normal opposes the one rotated by their nodes.
        volume: (2,) minimum and maximum relative to the volume at rest; NaN for an open mesh.
        gap: largest gap between shells that touch at rest, metres.
        hold_speed: speed of the fastest node during attachment, metres per second.
        hold_push: the same, minus the speed of the performers' fastest joint.
        lowest: height of the lowest vertex above the floor, metres.
    """

    stretch_95: float
    stretch_100: float
    squeeze_5: float
    inverted: float
    volume: tuple[float, float]
    gap: float
    hold_speed: float
    hold_push: float
    lowest: float

    def __str__(self) -> str:
        low, high = self.volume
        parts = [
            f"stretch {self.stretch_95:.2f} / {self.stretch_100:.1f}, squeeze {self.squeeze_5:.2f}",
            f"inverted {100 * self.inverted:.2f} %, volume {low:.2f}..{high:.2f}",
            f"gap {1000 * self.gap:.0f} mm",
            f"takes hold at {self.hold_speed:.1f} m/s (joints {self.hold_speed - self.hold_push:.1f})",
            f"lowest {self.lowest:.2f} m",
        ]
        return ", ".join(parts)


def measure(take: Take, every: int = 3) -> Measures:
    """Measures every ``every``-th shot from the first attachment on."""
    character = take.character
    ruler = _Ruler(character)
    begin = take.held_ns[0] if take.held_ns else 0
    rows = [ruler(shot.pose) for shot in [s for s in take.shots if s.time_ns >= begin][::every]]
    measured = np.array(rows)
    speed, push = _hold_speed(take)
    return Measures(
        float(measured[:, 0].max()),
        float(measured[:, 1].max()),
        float(measured[:, 2].min()),
        float(measured[:, 3].max()),
        (float(measured[:, 4].min()), float(measured[:, 4].max())),
        float(measured[:, 5].max()),
        speed,
        push,
        float(measured[:, 6].min()),
    )


class _Ruler:
    """Measures one pose against the mesh at rest."""

    def __init__(self, character: Character) -> None:
        mesh, of = weld(Mesh(character.vertices.astype(np.float64), character.faces))
        faces = of[character.faces].astype(np.int32)
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
        self.edges, counts = np.unique(edges, axis=0, return_counts=True)
        self.closed = bool((counts == 2).all())
        self.faces, self.character = faces, character
        self.first = np.full(len(mesh.vertices), -1)
        self.first[of[::-1]] = np.arange(len(of))[::-1]
        self.rest = character.vertices[self.first].astype(np.float64)
        self.lengths = self._lengths(self.rest)
        normals = Mesh(self.rest, faces).vertex_normals()
        self.normals = np.ascontiguousarray(normals[of], np.float32)
        self.pairs = _find_touching_pairs(self.rest, faces)
        self.volume = _volume(self.rest, faces)

    def __call__(self, pose) -> tuple[float, ...]:
        scale = float(np.median(np.cbrt(np.abs(np.linalg.det(pose.linear.astype(np.float64))))))
        vertices = skin_vertices(self.character, pose)[self.first].astype(np.float64)
        ratio = self._lengths(vertices)[self.kept] / (scale * self.lengths[self.kept])
        turned = skin_normals(self.character, pose, self.normals)[self.first]
        a, b, c = (vertices[self.faces[:, k]] for k in range(3))
        facing = np.einsum("fi,fi->f", np.cross(b - a, c - a), turned[self.faces].mean(1))
        a, b, c = (self.rest[self.faces[:, k]] for k in range(3))
        before = np.einsum("fi,fi->f", np.cross(b - a, c - a), self.normals[self.first][self.faces].mean(1))
        plain = before > 0.3 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        volume = _volume(vertices, self.faces) / (scale**3 * self.volume) if self.closed else np.nan
        p, q = self.pairs.T
        apart = np.linalg.norm(vertices[p] - vertices[q], axis=1) / scale
        gap = (apart - np.linalg.norm(self.rest[p] - self.rest[q], axis=1)).max(initial=0.0)
        return (
            float(np.percentile(ratio, 95)),
            float(ratio.max()),
            float(np.percentile(ratio, 5)),
            float((facing[plain] < 0).mean()),
            volume,
            float(gap),
            float(vertices[:, 1].min()),
        )

    @property
    def kept(self) -> Float:
        """Returns the edges that are long enough for a meaningful ratio."""
        return np.asarray(self.lengths > 0.2 * np.median(self.lengths))

    def _lengths(self, vertices: Float) -> Float:
        return np.asarray(np.linalg.norm(vertices[self.edges[:, 0]] - vertices[self.edges[:, 1]], axis=1))


def _volume(vertices: Float, faces: Int) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def _find_touching_pairs(vertices: Float, faces: Int) -> Int:
    """Returns (P, 2) the closest vertices of every two shells that nearly touch."""
    shell = shells(faces, len(vertices))
    pairs = []
    for label in np.unique(shell):
        mine, others = np.flatnonzero(shell == label), np.flatnonzero(shell > label)
        if len(others) == 0:
            continue
        length, nearest = cKDTree(vertices[mine]).query(vertices[others])
        for other in np.unique(shell[others]):
            of = np.flatnonzero(shell[others] == other)
            at = of[np.argmin(length[of])]
            if length[at] < _TOUCHING:
                pairs.append((mine[nearest[at]], others[at]))
    return np.array(pairs, np.int64).reshape(-1, 2)


def _hold_speed(take: Take) -> tuple[float, float]:
    """Returns the speed of the fastest node during attachment, metres per second, and its excess over that of
    the joints."""
    fastest, push = 0.0, 0.0
    for before, after in zip(take.shots, take.shots[1:], strict=False):
        seconds = (after.time_ns - before.time_ns) * 1e-9
        if not any(-0.05 <= (after.time_ns - held) * 1e-9 <= _SECONDS_OF_HOLD for held in take.held_ns):
            continue
        step = after.pose.positions - before.pose.positions
        speed = float(np.linalg.norm(step, axis=1).max()) / seconds
        was = {body.id: body for body in before.bodies}
        joints = [
            np.linalg.norm(body.joints - was[body.id].joints, axis=1).max() / seconds
            for body in after.bodies
            if body.id in was
        ]
        fastest, push = max(fastest, speed), max(push, speed - max(joints, default=0.0))
    return fastest, push
