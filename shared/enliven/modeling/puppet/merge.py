"""Merges two puppets without baking: the control points and the key poses of both are kept.

At the time of the merge both keep their poses. Key poses of both are kept. If only one puppet has a certain
key pose, the control points of the other puppet get their positions from that puppet's own motion. So both
puppets keep moving as before, and their surfaces become one surface. If the graft plays the same takes as the
host, or no take, it rigidly follows the host's surface around the meeting point. Its own motion is added on
top. A graft that plays another take cannot follow the host, because its frames do not determine the host's
pose. Such a graft moves about its position at the time of the merge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from enliven.arrays import AnyArray, Bool, Float, Int
from enliven.document import (
    ControlPoint,
    ExampleCharacter,
    KeyPose,
    Project,
    PuppetLayer,
    SkinWeights,
    unused,
)
from enliven.errors import InputError
from enliven.examples.puppet_examples import find_missing_examples, find_nearest_frame
from enliven.examples.puppet_motion import convert_to_world_frame, solve_layer_motion
from enliven.modeling.mesh.boolean_union import Union
from enliven.modeling.mesh.mesh_union import unite_meshes
from enliven.modeling.mesh.seam import smooth_seam
from enliven.modeling.puppet.parts import (
    add_moment,
    align_puppet,
    evaluate_puppet_state,
    find_nearest_paired,
    find_needed_points,
    remove_symmetry_plane,
    solve_surfaces,
    surface_of_puppet,
)
from enliven.modeling.rig import Merge
from enliven.rotation import nearest_rotation

_REGION_RADIUS_FRACTION = 0.08
"""Radius of the surface region around the meeting point, as a fraction of the puppet's size. It is about the
thickness of a limb."""
_MIN_REGION_VERTICES = 12
"""Minimum number of vertices in this region, because a rigid fit needs several. It matters for very coarse
meshes."""
_MAX_NEW_POINTS = 16
"""Maximum number of new control points. It is small, because the user may have to drag each of them."""
_MAX_POSE_ERROR = 0.01
"""Error of a key pose, as a fraction of the puppet's size, above which one more control point is added."""


@dataclass(frozen=True)
class _Rigid:
    """A rigid motion x -> turn x + move, with turn (4,) and move (3,) in metres."""

    turn: Float
    move: Float

    def __call__(self, points: AnyArray) -> Float:
        return np.asarray(points @ self.turn.T + self.move)

    def after(self, other: _Rigid) -> _Rigid:
        """Returns the composition: first the other motion, then this motion."""
        return _Rigid(self.turn @ other.turn, self.turn @ other.move + self.move)

    @property
    def inverse(self) -> _Rigid:
        """Returns the inverse motion."""
        return _Rigid(self.turn.T, -self.turn.T @ self.move)


def merge_puppets(project: Project, merge: Merge) -> Project:
    """Attaches a puppet to another puppet in their poses at a time. The host keeps its name and its path.

    The meshes are united at rest. The graft is first aligned to the host at the point where the two meet, so
    that they meet as in these poses. The layers of both puppets are kept, and each layer moves the same
    control points as before. The graft's layers no longer travel, and its hard constraints are dropped.

    Raises:
        InputError: if the union of the meshes fails.
    """
    time, messages, old_host = merge.time, merge.notes, project.puppet(merge.host)
    host, graft = (_Side(project, project.puppet(name), time) for name in (merge.host, merge.graft))
    keys = list(dict.fromkeys([*host.keys, *graft.keys]))
    host.solve_key_pose_surfaces(keys)
    graft.solve_key_pose_surfaces(keys)
    middle = _find_meeting_point(host.seen, graft.seen)
    to_host, to_graft = host.fit_surface_motion(middle), graft.fit_surface_motion(middle)
    united_mesh = _unite_mesh(host.puppet, graft.puppet, to_host.inverse.after(to_graft), merge)
    merged = _Merge(host, graft, united_mesh, keys, middle).build_puppet(messages)
    project = project.drop_character(merge.graft)
    state = evaluate_puppet_state(project.with_characters(merged), merged, time)
    return project.with_characters(align_puppet(merged, state, old_host, host.state))


class _Side:
    """One of the two puppets: its pose at the time of the merge, and in every key pose of both.

    Attributes:
        puppet: the puppet without a symmetry plane, and with its pose at that time as a key pose if possible.
        state: the puppet's state at that time.
        seen: (V, 3) metres in the world, the puppet's vertices at that time.
        keys: the takes and frames of the puppet's key poses.
        was: (n, V, 3) metres, the puppet's surface in each of the n key poses, in the frame of its mesh.
    """

    def __init__(self, project: Project, puppet: ExampleCharacter, time: float) -> None:
        self._project, self.state = project, evaluate_puppet_state(project, puppet, time)
        self._surface = surface_of_puppet(puppet)
        self.local = self._surface.solve_from_rest(self.state.places)
        self.seen = convert_to_world_frame(puppet, self.state, self.local)
        self.puppet = remove_symmetry_plane(project, add_moment(project, puppet, time))
        takes = project.takes
        self.keys = [
            (pose.take, find_nearest_frame(takes[pose.take], pose.time)) for pose in self.puppet.poses
        ]
        self.was = np.zeros((0, *puppet.mesh.vertices.shape))

    @property
    def world(self) -> _Rigid:
        """The rigid motion from the mesh's frame to the world at the time of the merge."""
        corners = convert_to_world_frame(
            self.puppet, self.state, np.concatenate([np.zeros((1, 3)), np.eye(3)])
        )
        return _Rigid((corners[1:] - corners[0]).T, corners[0])

    def solve_key_pose_surfaces(self, keys: Sequence[tuple[str, int]]) -> None:
        """Computes this puppet's surface in the key poses ``keys`` (take, frame) of both puppets."""
        count = len(self.puppet.points)
        places = np.array([self._key_places(key) for key in keys]).reshape(len(keys), count, 3)
        self.was = solve_surfaces(self._surface, places)

    def fit_surface_motion(self, middle: Float) -> _Rigid:
        """Returns the rigid motion from rest to the world of the surface around a point (3,), at the time of
        the merge."""
        self._near = _vertices_around(self.seen, middle, self.puppet)
        return _fit_rigid_motion(self.puppet.mesh.vertices[self._near], self.seen[self._near])

    def find_key_pose_motion(self, key: int) -> _Rigid:
        """Returns the rigid motion of the surface around the meeting point, from the time of the merge to a
        key pose."""
        return _fit_rigid_motion(self.local[self._near], self.was[key][self._near])

    def _key_places(self, key: tuple[str, int]) -> Float:
        """Returns the puppet's control points (P, 3) in metres, in its mesh's frame: from its key pose, or
        from its own motion.
        """
        if key in self.keys:
            return self.puppet.poses[self.keys.index(key)].places
        if find_missing_examples(self._project, self.puppet):
            return self.puppet.rest
        trial = self.puppet.with_changes(layers=(PuppetLayer(key[0], travel=False),))
        try:
            return solve_layer_motion(self._project, trial, 0).places_at(key[1])
        except InputError:
            return self.puppet.rest


class _Merge:
    """A builder of the merged puppet."""

    def __init__(
        self, host: _Side, graft: _Side, union: Union, keys: Sequence[tuple[str, int]], middle: Float
    ) -> None:
        self._host, self._graft, self._union, self._keys = host, graft, union, keys
        count = len(union.mesh.vertices)
        ours, theirs = union.first >= 0, (union.second >= 0) & (union.first < 0)
        base = host.world.inverse.after(graft.world)
        self.rides = _plays_same_frames(host.puppet, graft.puppet)
        self._was = np.zeros((len(keys), count, 3))
        for number in range(len(keys)):
            carry = host.find_key_pose_motion(number).after(base) if self.rides else base
            self._was[number, ours] = host.was[number][union.first[ours]]
            self._was[number, theirs] = carry(graft.was[number])[union.second[theirs]]
        self._mine = (ours, theirs)

    def build_puppet(self, notes: list[str]) -> ExampleCharacter:
        """Returns the merged puppet, with the layers of both."""
        host, graft = self._host.puppet, self._graft.puppet
        ours = self._points_on_union(host, self._union.first, set(), notes)
        theirs = self._points_on_union(
            graft, np.where(self._mine[1], self._union.second, -1), set(ours), notes
        )
        points = [*ours.values(), *theirs.values()]
        merged = self._puppet_with_points(points)
        size = float(np.linalg.norm(np.ptp(merged.mesh.vertices, axis=0)))
        is_known = self._is_far_from_seam()
        none = np.zeros(0, np.int64)
        added, worst = find_needed_points(
            merged, self._was, is_known, none, _MAX_NEW_POINTS, _MAX_POSE_ERROR * size
        )
        more: dict[str, ControlPoint] = {}
        names = {point.name: point for point in points}
        sides = [ours, theirs]
        for vertex in added:
            side = sides[int(self._mine[1][vertex])]
            leader = find_nearest_paired(merged.mesh, list(side.values()), [vertex])[0]
            name = unused(f"{leader.name} seam" if leader else "seam", names)
            names[name] = more[name] = ControlPoint(name, vertex, leader.joint if leader else "")
            side[name] = names[name]
        notes.append(
            f"The merged puppet got {len(added)} more control points. Away from the seam, the key "
            f"poses deviate from the original poses by at most {1000 * worst:.1f} mm "
            f"({100 * worst / size:.2f} % of the puppet's size)."
        )
        if not self.rides:
            difference = f"The puppet {graft.id!r} plays another take than {host.id!r}"
            notes.append(
                f"{difference}. So {graft.id!r} moves around its current position, and the joined "
                "surface follows both."
            )
        if any(layer.positions or layer.velocities or layer.couplings for layer in graft.layers):
            notes.append(f"The hard constraints of {graft.id!r} were removed.")
        return self._puppet_with_points([*points, *more.values()]).with_changes(
            layers=self._merge_layers(ours, theirs)
        )

    def _points_on_union(
        self, puppet: ExampleCharacter, of: Int, used_names: set[str], notes: list[str]
    ) -> dict[str, ControlPoint]:
        """Returns the control points on the united mesh, keyed by their old names. New points come last.

        If the union removed a point's vertex, the point moves to the nearest remaining vertex.
        """
        remaining = np.flatnonzero(of >= 0)
        number = np.full(len(puppet.mesh.vertices), -1)
        number[of[remaining]] = remaining
        out: dict[str, ControlPoint] = {}
        used: set[int] = set()
        for point in puppet.points:
            vertex = int(number[point.vertex])
            if vertex < 0 or vertex in used:
                gaps = np.linalg.norm(
                    puppet.mesh.vertices[of[remaining]] - puppet.mesh.vertices[point.vertex], axis=1
                )
                gaps[np.isin(remaining, list(used))] = np.inf
                vertex = int(remaining[np.argmin(gaps)])
                notes.append(
                    f"The control point {point.name!r} was inside the other puppet, so it was moved to the "
                    "nearest vertex of the merged mesh."
                )
            used.add(vertex)
            out[point.name] = replace(point, vertex=vertex)
        return out if not used_names else self._rename_taken_points(out, used_names)

    def _rename_taken_points(
        self, points: dict[str, ControlPoint], used_names: set[str]
    ) -> dict[str, ControlPoint]:
        """Renames control points with names that are taken. Returns all control points, keyed by their old
        names."""
        names = dict.fromkeys(used_names)
        for old, point in points.items():
            points[old] = replace(point, name=unused(old, names))
            names[points[old].name] = None
        return points

    def _puppet_with_points(self, points: list[ControlPoint]) -> ExampleCharacter:
        vertices = [point.vertex for point in points]
        takes = self._host._project.takes
        poses = tuple(
            KeyPose(take, frame * takes[take].step, self._was[number][vertices])
            for number, (take, frame) in enumerate(self._keys)
        )
        return self._host.puppet.with_changes(
            mesh=replace(self._union.mesh, name=self._host.puppet.mesh.name),
            points=tuple(points),
            poses=poses,
            layers=(),
        )

    def _is_far_from_seam(self) -> Bool:
        """Returns (V,) True for vertices of the two puppets that are not near the seam."""
        mesh, seam = self._union.mesh, self._union.seam
        either = self._mine[0] | self._mine[1]
        if not seam.any():
            return either
        size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
        away = scipy.spatial.cKDTree(mesh.vertices[seam]).query(mesh.vertices)[0]
        return np.asarray(either & (away > _REGION_RADIUS_FRACTION * size))

    def _merge_layers(
        self, ours: dict[str, ControlPoint], theirs: dict[str, ControlPoint]
    ) -> tuple[PuppetLayer, ...]:
        """Returns the layers of both puppets, each for its own control points. Layers that play the same take
        in the same way are combined."""
        host, graft = (
            [self._layer_with_new_points(layer, puppet, side) for layer in puppet.layers]
            for puppet, side in ((self._host.puppet, ours), (self._graft.puppet, theirs))
        )
        bare = [replace(layer, positions=(), velocities=(), couplings=(), travel=False) for layer in graft]
        if not bare:
            carried = tuple(point.name for point in theirs.values())
            return tuple(replace(layer, points=(*layer.points, *carried)) for layer in host)
        if self.rides and len(bare) == len(host):
            both = zip(host, bare, strict=True)
            return tuple(replace(layer, points=(*layer.points, *other.points)) for layer, other in both)
        return (*host, *bare)

    def _layer_with_new_points(
        self, layer: PuppetLayer, puppet: ExampleCharacter, side: dict[str, ControlPoint]
    ) -> PuppetLayer:
        """Returns a layer of one puppet, with its control points renamed and new control points added."""
        old = [point.name for point in puppet.points]
        new = [point.name for name, point in side.items() if name not in old]
        return replace(layer, points=(*(side[name].name for name in layer.points or old), *new))


def _plays_same_frames(host: ExampleCharacter, graft: ExampleCharacter) -> bool:
    """Returns True if graft and host play the same frames of the same takes, so that the host can carry the
    graft."""
    played_takes = [
        {(layer.take, layer.offset, layer.speed, layer.loop) for layer in puppet.layers if not layer.muted}
        for puppet in (host, graft)
    ]
    return not played_takes[1] or played_takes[0] == played_takes[1]


def _unite_mesh(host: ExampleCharacter, graft: ExampleCharacter, to: _Rigid, merge: Merge) -> Union:
    """Returns the union of both meshes at rest, with the graft moved by ``to`` and the seam smoothed."""
    moved = replace(graft.mesh, vertices=to(graft.mesh.vertices))
    union = unite_meshes(
        host.mesh, _placeholder_skin(host), moved, _placeholder_skin(graft), offset=1, tidy=True
    )
    if union.failed and not merge.loose:
        remedy = (
            "Repair the mesh, or merge without a union: both meshes then remain separate shells in one mesh."
        )
        raise InputError(
            f"the union of the two meshes failed: {union.notes[0]}", where=host.where, remedy=remedy
        )
    merge.notes.extend(union.notes)
    return replace(union, mesh=smooth_seam(union.mesh, union.seam, merge.seam)) if union.seam.any() else union


def _placeholder_skin(puppet: ExampleCharacter) -> SkinWeights:
    """Returns a placeholder skin with full weight on bone 0, because a union needs skins."""
    count = len(puppet.mesh.vertices)
    weights = np.zeros((count, 4), np.float32)
    weights[:, 0] = 1.0
    return SkinWeights(np.zeros((count, 4), np.uint16), weights)


def _find_meeting_point(ours: Float, theirs: Float) -> Float:
    """Returns the centre of the region in which two surfaces are nearest, (3,) in metres of the world."""
    distances, nearest = scipy.spatial.cKDTree(ours).query(theirs)
    scale = 0.02 * float(np.linalg.norm(np.ptp(theirs, axis=0)))
    near = distances <= distances.min() + scale
    return np.asarray((theirs[near].mean(0) + ours[nearest[near]].mean(0)) / 2)


def _vertices_around(points: Float, middle: Float, puppet: ExampleCharacter) -> Int:
    """Returns the vertices near the point ``middle`` (3,), sorted by distance in space."""
    size = float(np.linalg.norm(np.ptp(puppet.mesh.vertices, axis=0)))
    distances = np.linalg.norm(points - middle, axis=1)
    order = np.argsort(distances, kind="stable")
    count = max(
        int((distances <= distances.min() + _REGION_RADIUS_FRACTION * size).sum()),
        min(_MIN_REGION_VERTICES, len(points)),
    )
    return order[:count]


def _fit_rigid_motion(source_points: Float, target_points: Float) -> _Rigid:
    """Returns the best rigid motion from ``source_points`` (N, 3) to ``target_points`` (N, 3)."""
    old_middle, new_middle = source_points.mean(0), target_points.mean(0)
    turn = nearest_rotation((target_points - new_middle).T @ (source_points - old_middle))
    return _Rigid(turn, new_middle - turn @ old_middle)
