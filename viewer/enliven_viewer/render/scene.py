"""A scene: characters in their poses, bodies, cues, and the strength of each overlay."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float, Float32
from enliven.document import BOX, Character, Pose, Props
from enliven.matching.match_list import MatchList
from enliven.person import Body
from enliven_viewer.playback.document import Document, find_bounds
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.playback.timeline import CueFrame, TimelineMoment
from enliven_viewer.render.camera import Box

_LOOSE_VIEW_DISTANCE = 0.7
"""The camera keeps loose boxes in view that are within this distance in metres of characters and bodies."""
_LOOSE_SHADOW_DISTANCE = 1.4
"""Loose objects within this distance in metres of characters and bodies cast shadows. It is twice
:data:`_LOOSE_VIEW_DISTANCE`.
"""


@dataclass(frozen=True)
class SceneStyle:
    """The strength of each overlay in a scene, from 0 (hidden) to 1.

    Attributes:
        body: the performer's skeleton.
        reveal: transparency of the mesh around a body inside it.
        cues: glowing attachment points.
        graph: nodes and edges of the deformation graph, or bones.
        held: glow on the attached parts.
    """

    body: float = 1.0
    reveal: float = 1.0
    cues: float = 1.0
    graph: float = 0.0
    held: float = 1.0


PLAIN = SceneStyle(body=0.0, reveal=0.0, cues=0.0, graph=0.0, held=0.0)
"""Only meshes, without overlays: the studio's style for shapes and puppets."""


@dataclass(frozen=True)
class SceneCharacter:
    """One character in one pose.

    Attributes:
        vertices: (V, 3) float32 metres in the world, if a solver computed the surface; None if the
            character's transforms move its vertices.
    """

    character: Character
    pose: Pose
    cues: CueFrame | None = None
    vertices: Float32 | None = None

    @property
    def extent(self) -> Float32:
        """Returns points on the solved surface, or the pivots, (N, 3) in metres."""
        return self.pose.positions if self.vertices is None else self.vertices


@dataclass(frozen=True)
class Scene:
    """The contents of one rendered image."""

    actors: tuple[SceneCharacter, ...] = ()
    bodies: tuple[Body, ...] = ()
    style: SceneStyle = field(default_factory=SceneStyle)
    props: Props | None = None
    boards: dict[str, MatchList] = field(default_factory=dict)
    extent: Box | None = None
    """Lowest and highest corner of all surfaces, if known. The shadow maps cover this box."""

    @property
    def box(self) -> Box | None:
        """Returns the box that a camera should show, or None if the scene is empty."""
        boxes = None if self.props is None else self.props.positions[self.props.shapes == BOX]
        # Exclude balls, because they appear and disappear too fast for a camera to follow.
        return self._find_box(boxes, _LOOSE_VIEW_DISTANCE)

    @property
    def lit_box(self) -> Box | None:
        """Returns the box in which shadows are drawn: slightly larger than :attr:`box`."""
        return self._find_box(None if self.props is None else self.props.positions, _LOOSE_SHADOW_DISTANCE)

    def _find_box(self, loose: Float | None, reach: float) -> Box | None:
        """Returns a box with a margin around characters, bodies, and the loose objects that are nearer than
        ``reach`` metres.
        """
        points = [actor.extent for actor in self.actors] + [body.joints for body in self.bodies]
        if self.extent is not None:
            points.append(np.stack(self.extent))
        bounds = find_bounds(points)
        if bounds is None:
            return None
        if loose is not None and len(loose):
            bounds = find_bounds([np.stack(bounds), _pull_towards(loose, bounds, reach)]) or bounds
        margin = np.array([0.12, 0.12, 0.12])
        low, high = bounds[0] - margin, bounds[1] + margin
        low[1] = min(low[1], 0.0)
        return low, high


def make_scene(
    document: Document,
    moment: TimelineMoment | None,
    style: SceneStyle,
    surfaces: SolvedSurfaces | None = None,
) -> Scene:
    """Returns the scene at one time. A character without any pose, or with a pose that does not match it, is
    in its rest pose.

    A character that has poses only at other times is not drawn: it had not appeared yet, or was removed.

    Args:
        surfaces: solver of the puppets' surfaces. Without a solver, each puppet is drawn rigidly.
    """
    actors = []
    characters = document.characters_at(moment)
    for character in characters.values():
        pose = moment.poses.get(character.id) if moment else None
        if pose is None and character.id in document.timeline.posed:
            continue
        if pose is None or len(pose.linear) != len(character.pivots):
            pose = character.rest_pose()
        cues = moment.cues.get(character.id) if moment else None
        vertices = None if surfaces is None else surfaces.vertices(character, pose)
        actors.append(SceneCharacter(character, pose, cues, vertices))
    if surfaces is not None:
        surfaces.keep_only(characters.values())
    bodies = moment.bodies if moment else ()
    present_bodies = tuple(b for b in bodies if np.isfinite(b.joints).all())
    boards = {name: b for name, b in moment.boards.items() if name in characters} if moment else {}
    return Scene(tuple(actors), present_bodies, style, moment.props if moment else None, boards)


def _pull_towards(positions: Float, box: Box, reach: float) -> Float:
    """Returns (N, 3) positions in metres. Positions farther from the box than ``reach`` are pulled towards
    it. So the camera follows an object that rolls away less and less, and ignores it beyond twice the reach.
    """
    clipped = np.clip(positions, box[0], box[1])
    offsets = positions - clipped
    length = np.linalg.norm(offsets, axis=1, keepdims=True)
    fraction = np.clip(2 * reach / np.maximum(length, 1e-9) - 1, 0.0, 1.0)
    return np.asarray(clipped + fraction * offsets)


def find_corners(box: Box) -> Float:
    """Returns (8, 3): the corners of a box."""
    grid = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), -1).reshape(8, 3)
    return np.where(grid == 0, box[0], box[1]).astype(np.float64)
