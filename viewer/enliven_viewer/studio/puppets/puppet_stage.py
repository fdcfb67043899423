"""The puppets on the studio's stage at one time."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np

from enliven.arrays import AnyArray, Float, Float32
from enliven.document import Character, ExampleCharacter, RigBase, SkinWeights
from enliven.examples.puppet_motion import PuppetState, convert_to_world_frame, pose_of_state
from enliven.modeling.edits import bake_root_layers
from enliven.rotation import from_rotation_vector, multiply, rotate, to_matrix
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.protocols import PoseEditState
from enliven_viewer.studio.puppets.puppet_states import find_playback_state
from enliven_viewer.studio.puppets.surfaces import PuppetSurfaces
from enliven_viewer.studio.viewport.colours import DrawnMeshes
from enliven_viewer.studio.viewport.ray import moved
from enliven_viewer.studio.viewport.stage_character import StageCharacter


@dataclass(frozen=True, eq=False)
class StagePuppet(StageCharacter):
    """A puppet on the stage at one time.

    Attributes:
        surface: (V, 3) vertices in metres of the mesh's frame.
    """

    character: ExampleCharacter
    state: PuppetState
    surface: Float

    has_own_tool = True

    @cached_property
    def vertices(self) -> Float:
        """Returns the vertices (V, 3) in metres of the world."""
        return self.to_world(self.surface)

    @cached_property
    def solved(self) -> Float32:
        """Returns (V, 3) float32 metres in the world."""
        vertices = np.empty(self.surface.shape, np.float32)
        moved(self.surface, self._turn, self._root, vertices)
        return vertices

    def to_world(self, places: AnyArray) -> Float:
        """Converts positions (N, 3) from the mesh's frame to the world, in metres."""
        positions = np.empty(np.shape(places), np.float64)
        moved(np.asarray(places, np.float64), self._turn, self._root, positions)
        return positions

    def to_mesh(self, places: AnyArray) -> Float:
        """Converts positions (..., 3) from the world to the mesh's frame, in metres."""
        return np.asarray((np.asarray(places, np.float64) - self._root) @ self._turn)

    def direction_to_mesh(self, direction: AnyArray) -> Float:
        """Returns (3,) in the mesh's frame, for a direction (3,) in the world."""
        return np.asarray(np.asarray(direction, np.float64) @ self._turn)

    @cached_property
    def _turn(self) -> Float:
        """Returns the (3, 3) rotation from the mesh to the world."""
        yaw = from_rotation_vector(np.array([0.0, self.state.yaw, 0.0]))
        return np.asarray(to_matrix(multiply(self.character.turn, yaw)))

    @cached_property
    def _root(self) -> Float:
        """Returns the position (3,) in metres of the mesh's origin in the world."""
        return np.asarray(rotate(self.character.turn, self.state.root) + self.character.place)


class PuppetStage:
    """All puppets of an editor's project in their current poses. They are cached while nothing changes."""

    def __init__(self, editor: Editor, posing: PoseEditState) -> None:
        self.editor, self.posing = editor, posing
        self.surfaces, self._meshes = PuppetSurfaces(editor.toasts), create_puppet_meshes()
        self._cache: tuple[tuple[object, ...], tuple[StagePuppet, ...]] | None = None
        self._version = 0
        self._ghost: StagePuppet | None = None
        self._ghost_request: tuple[tuple[object, ...], Future[Float]] | None = None

    @property
    def ghost(self) -> StagePuppet | None:
        """Returns the puppet in the previous key pose, or None without a previous key pose, or while it is
        being solved.
        """
        posing, puppet = self.posing, self.posing.puppet
        pose, now = posing.previous, self.find(puppet.id) if puppet is not None else None
        if puppet is None or pose is None or now is None or not posing.silhouette:
            return None
        key = (pose.places, puppet.points, puppet.mesh, now.state.yaw, puppet.place, puppet.turn)
        if self._ghost_request is None or not _is_unchanged(self._ghost_request[0], key):
            future = self.surfaces.solve_in_background(puppet, pose.places)
            self._ghost_request = None if future is None else (key, future)
        if (
            self._ghost_request is not None
            and self._ghost_request[1].done()
            and self._ghost_request[1].exception() is None
        ):
            surface = self._ghost_request[1].result()
            if self._ghost is None or self._ghost.surface is not surface:
                state = PuppetState(pose.places, now.state.yaw, now.state.root)
                self._ghost = self._make_stage_puppet(puppet, state, surface)
            return self._ghost
        return None

    def wait(self) -> None:
        """Waits for the ghost. For sessions without a window."""
        if self.ghost is None and self._ghost_request is not None:
            self._ghost_request[1].result()

    @property
    def puppets(self) -> tuple[StagePuppet, ...]:
        """Returns all puppets, in the project's order."""
        editor, posing = self.editor, self.posing
        project = editor.project
        key = (project, posing.places, editor.time, posing.number, self.surfaces.version, self._version)
        if self._cache is None or not _is_unchanged(self._cache[0], key):
            self.surfaces.keep_only(set(project.puppets))
            self._cache = (key, tuple(self._place_puppet(puppet) for puppet in project.puppets.values()))
        return self._cache[1]

    def find(self, puppet_id: str) -> StagePuppet | None:
        """Returns one of the puppets, or None for an unknown id."""
        return next((s for s in self.puppets if s.id == puppet_id), None)

    def stage_puppet(self, puppet: RigBase) -> StagePuppet:
        """Returns a puppet of the project in its current pose."""
        return next(candidate for candidate in self.puppets if candidate.id == puppet.id)

    def improve(self) -> None:
        """Runs more solver iterations on dragged surfaces, and fetches surfaces solved in the background.

        Call once per frame.
        """
        self.surfaces.improve()
        if any(self.posing.motion_solver.busy(name) for name in self.editor.project.puppets):
            self._version += 1

    def _place_puppet(self, puppet: ExampleCharacter) -> StagePuppet:
        editor, posing, newest = self.editor, self.posing, puppet
        places = posing.places if posing.puppet is puppet else None
        if places is not None and len(places) == len(puppet.points):
            shown_state = posing.start_state or find_playback_state(editor, posing.motion_solver, puppet)[1]
            state = PuppetState(places, shown_state.yaw, shown_state.root)
        else:
            puppet, state = find_playback_state(editor, posing.motion_solver, puppet)
        if newest.root_layers or puppet.root_layers:
            puppet = puppet.with_changes(root_layers=newest.root_layers)
            puppet = cast(ExampleCharacter, bake_root_layers(editor.project, puppet, editor.time))
        warm = editor.playing or editor.scrubbing or posing.is_dragging
        return self._make_stage_puppet(puppet, state, self.surfaces.solve(puppet, state.places, warm=warm))

    def _make_stage_puppet(self, puppet: ExampleCharacter, state: PuppetState, surface: Float) -> StagePuppet:
        handles = convert_to_world_frame(puppet, state, state.places)
        return StagePuppet(
            puppet, self._meshes.get_mesh(puppet), pose_of_state(puppet, state), handles, state, surface
        )


def _is_unchanged(before: tuple[object, ...], after: tuple[object, ...]) -> bool:
    """Returns True if nothing changed. Objects are compared by identity, numbers by value."""
    return all(
        a is b or (isinstance(a, float | int) and isinstance(b, float | int) and a == b)
        for a, b in zip(before, after, strict=True)
    )


def create_puppet_meshes() -> DrawnMeshes:
    """Returns the cache of the puppets' render meshes. Each mesh has one rigid transform, because its
    vertices are solved on the CPU.
    """
    return DrawnMeshes(_make_rigid_mesh)


def _make_rigid_mesh(puppet: RigBase) -> Character:
    mesh = puppet.mesh
    assert mesh is not None
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(mesh.vertices), 1))
    return Character(
        id=puppet.id,
        vertices=mesh.vertices.astype(np.float32),
        faces=mesh.faces,
        skin=SkinWeights(np.zeros(weights.shape, np.uint16), weights),
        pivots=np.zeros((1, 3), np.float32),
        edges=np.zeros((0, 2), np.int32),
        colours=mesh.colours,
        materials=mesh.materials,
    )
