"""The puppets on the studio's stage at a moment, and the one under the pointer."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Future
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from enliven.arrays import AnyArray, Float, Float32
from enliven.document import Character, Pose, Puppet, SkinWeights
from enliven.examples import State, pose_of_state
from enliven.meshes import Mesh
from enliven.rotation import from_rotation_vector, multiply, rotate, to_matrix
from enliven_viewer.studio.puppets.editing import Editing, Posing
from enliven_viewer.studio.puppets.playing import played_state
from enliven_viewer.studio.puppets.ray import first_hit, moved
from enliven_viewer.studio.puppets.surfaces import PuppetSurfaces
from enliven_viewer.studio.viewport import Lens, coloured


@dataclass(frozen=True, eq=False)
class StandingPuppet:
    """A puppet on the stage at one moment.

    Attributes:
        surface: (V, 3) metres of its vertices, in the mesh's own frame.
    """

    puppet: Puppet
    state: State
    surface: Float

    @cached_property
    def pose(self) -> Pose:
        """The pose of its character."""
        return pose_of_state(self.puppet, self.state)

    @cached_property
    def vertices(self) -> Float:
        """(V, 3) metres in the world."""
        return self.out(self.surface)

    @cached_property
    def drawn(self) -> Float32:
        """(V, 3) float32 metres in the world."""
        made = np.empty(self.surface.shape, np.float32)
        moved(self.surface, self._turn, self._root, made)
        return made

    @cached_property
    def points(self) -> Float:
        """(P, 3) metres in the world, the control points."""
        return self.out(self.state.places)

    def out(self, places: AnyArray) -> Float:
        """(N, 3) metres in the world of places (N, 3) in the mesh's frame."""
        made = np.empty(np.shape(places), np.float64)
        moved(np.asarray(places, np.float64), self._turn, self._root, made)
        return made

    def into(self, places: AnyArray) -> Float:
        """(..., 3) metres in the mesh's frame of places (..., 3) in the world."""
        return np.asarray((np.asarray(places, np.float64) - self._root) @ self._turn)

    def way_into(self, way: AnyArray) -> Float:
        """(3,) in the mesh's frame, of a direction (3,) in the world."""
        return np.asarray(np.asarray(way, np.float64) @ self._turn)

    @cached_property
    def _turn(self) -> Float:
        """(3, 3) world from mesh."""
        yaw = from_rotation_vector(np.array([0.0, self.state.yaw, 0.0]))
        return np.asarray(to_matrix(multiply(self.puppet.turn, yaw)))

    @cached_property
    def _root(self) -> Float:
        """(3,) metres, where the mesh's origin is."""
        return np.asarray(rotate(self.puppet.turn, self.state.root) + self.puppet.place)


class PuppetStage:
    """Every puppet of an editor's project as it stands now; kept while nothing changes."""

    def __init__(self, editor: Editing, posing: Posing) -> None:
        self.editor, self.posing = editor, posing
        self.surfaces = PuppetSurfaces(editor.toasts)
        self._known: tuple[tuple[object, ...], tuple[StandingPuppet, ...]] | None = None
        self._polls = 0
        self._ghost: StandingPuppet | None = None
        self._wanted: tuple[tuple[object, ...], Future[Float]] | None = None

    @property
    def ghost(self) -> StandingPuppet | None:
        """The puppet in the key pose before the edited one; None without one, or while it is being solved."""
        posing, puppet = self.posing, self.posing.puppet
        pose, now = posing.previous, self.standing_of(puppet.id) if puppet is not None else None
        if puppet is None or pose is None or now is None or not posing.silhouette:
            return None
        key = (pose.places, puppet.points, puppet.mesh, now.state.yaw, puppet.place, puppet.turn)
        if self._wanted is None or not _same(self._wanted[0], key):
            future = self.surfaces.aside(puppet, pose.places)
            self._wanted = None if future is None else (key, future)
        if self._wanted is not None and self._wanted[1].done() and self._wanted[1].exception() is None:
            surface = self._wanted[1].result()
            if self._ghost is None or self._ghost.surface is not surface:
                state = State(pose.places, now.state.yaw, now.state.root)
                self._ghost = StandingPuppet(puppet, state, surface)
            return self._ghost
        return None

    def wait(self) -> None:
        """Wait for the ghost: for sessions without a window."""
        if self.ghost is None and self._wanted is not None:
            self._wanted[1].result()

    @property
    def standing(self) -> tuple[StandingPuppet, ...]:
        """All puppets, in the project's order."""
        editor, posing = self.editor, self.posing
        project = editor.project
        key = (project, posing.places, editor.time, posing.number, self.surfaces.version, self._polls)
        if self._known is None or not _same(self._known[0], key):
            self.surfaces.keep_only(set(project.puppets))
            self._known = (key, tuple(self._stands(puppet) for puppet in project.puppets.values()))
        return self._known[1]

    def standing_of(self, puppet_id: str) -> StandingPuppet | None:
        """One of them."""
        return next((s for s in self.standing if s.puppet.id == puppet_id), None)

    def improve(self) -> None:
        """Bring dragged surfaces nearer to rest and take solved ones; to be called once a picture."""
        self.surfaces.improve()
        if any(self.editor.solving.busy(name) for name in self.editor.project.puppets):
            self._polls += 1

    def _stands(self, puppet: Puppet) -> StandingPuppet:
        editor, posing = self.editor, self.posing
        places = posing.places if posing.puppet is puppet else None
        if places is not None and len(places) == len(puppet.points):
            way = posing.start_state or played_state(editor, puppet)[1]
            state = State(places, way.yaw, way.root)
        else:
            puppet, state = played_state(editor, puppet)
        warm = editor.playing or posing.dragging
        return StandingPuppet(puppet, state, self.surfaces.of(puppet, state.places, warm=warm))


def _same(before: tuple[object, ...], after: tuple[object, ...]) -> bool:
    """Whether nothing changed: objects by identity, numbers by value."""
    return all(
        a is b or (isinstance(a, float | int) and isinstance(b, float | int) and a == b)
        for a, b in zip(before, after, strict=True)
    )


def puppet_at(
    standing: Iterable[StandingPuppet], lens: Lens, at: tuple[float, float]
) -> tuple[StandingPuppet, int, float] | None:
    """The puppet that the ray of a pixel meets first, the face that it meets, and metres to it."""
    way, eye = lens.ray(at), lens.view.eye
    found = []
    for one in standing:
        face, distance = first_hit(one.vertices, one.puppet.mesh.faces, eye, way)
        if face >= 0:
            found.append((one, face, distance))
    return min(found, key=lambda hit: hit[2], default=None)


class PuppetCharacters:
    """The renderer's characters of puppets, the same object while the mesh stays the same."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[Mesh, Character]] = {}

    def of(self, puppet: Puppet) -> Character:
        """The character; its vertices are put where the surface was solved to be."""
        known = self._known.get(puppet.id)
        if known is None or known[0] is not puppet.mesh:
            known = self._known[puppet.id] = (puppet.mesh, coloured(_character(puppet)))
        return known[1]


def _character(puppet: Puppet) -> Character:
    """One rigid piece, so that a puppet without control points can be drawn too."""
    count = len(puppet.mesh.vertices)
    weights = np.zeros((count, 4), np.float32)
    weights[:, 0] = 1.0
    return Character(
        id=f"puppet {puppet.id}",
        vertices=puppet.mesh.vertices.astype(np.float32),
        faces=puppet.mesh.faces,
        skin=SkinWeights(np.zeros((count, 4), np.uint16), weights),
        pivots=np.zeros((1, 3), np.float32),
        edges=np.zeros((0, 2), np.int32),
        colours=puppet.mesh.colours,
    )
