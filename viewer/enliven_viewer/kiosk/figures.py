"""The figure of a character in the picture. It waits, turns to visitors, and blends smoothly into driven
poses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float32
from enliven.document import Character, Pose
from enliven.kiosk.visitors import Place
from enliven.possession import rotation_about_y
from enliven_viewer.playback.interpolation import blend_poses
from enliven_viewer.render.scene import SceneCharacter

STANDING_HEIGHT_M = 1.7
"""Height of a waiting mesh in metres, before a visitor's height is known."""
MAX_OWN_HEIGHT_M = 2.1
"""Puppets and rigged models up to this height in metres wait in their own size."""
_TURN_TIME_S = 0.12
"""Time constant of a character's turn to a visitor, in seconds. After 0.3 s, 92 % of the turn is
done."""
_SIZE_TIME_S = 0.5
"""Time constant of the size as it follows the visitor's height, in seconds."""
_NEAR_M = 0.25
"""The figure blends to the driven pose once the character is closer than this to its performer, in metres.
The edge moves a character to its performer within half a second. Until then the figure waits on the spot.
"""
_MAX_DELAY_S = 1.0
"""Maximum seconds to wait until the character is at its performer. Some characters stay next to their
performers.
"""
_PASSAGE_S = 0.5
"""Duration in seconds of the blend from one source of the pose to another, for example when a performer takes
control.
"""


@dataclass(frozen=True)
class WaitingPlace:
    """The position, direction and size of a waiting character.

    Attributes:
        place: point of the floor (x, z) in metres.
        yaw: angle about +Y in radians from +Z to the character's front.
        height: height of the character in metres. Puppets and rigged models keep their own height.
        size: scale factor, applied in addition to the height.
    """

    place: Place
    yaw: float = 0.0
    height: float = STANDING_HEIGHT_M
    size: float = 1.0


def stand_character(character: Character, standing: WaitingPlace) -> SceneCharacter:
    """Returns a character in its rest pose at a place."""
    rest = character.rest_pose()
    height = float(np.ptp(character.vertices[:, 1])) or 1.0
    scale = standing.height / height
    if character.kind != "graph":
        scale = min(1.0, MAX_OWN_HEIGHT_M / height)
    scale *= standing.size
    turn = (scale * rotation_about_y(standing.yaw)).astype(np.float32)
    floor = float(character.vertices[:, 1].min())
    offset = np.array([standing.place[0], -scale * floor, standing.place[1]], np.float32)
    pose = Pose(character.id, 0, turn @ rest.linear, rest.positions @ turn.T + offset)
    vertices = None
    if character.kind == "points":
        vertices = np.ascontiguousarray(character.vertices @ turn.T + offset, np.float32)
    return SceneCharacter(character, pose, None, vertices)


class CharacterFigure:
    """One character of the picture, from frame to frame.

    Args:
        place: point of the floor (x, z) in metres where it waits.
    """

    def __init__(self, place: Place) -> None:
        self._standing = WaitingPlace(place)
        self._shown: SceneCharacter | None = None
        self._start: SceneCharacter | None = None
        self._source = ""
        self._passed_s = _PASSAGE_S
        self._delayed_s = 0.0

    @property
    def standing(self) -> WaitingPlace:
        """Returns the position, direction and size of the character while it waits."""
        return self._standing

    def turn_to(self, place: Place, yaw: float, height: float, seconds: float) -> None:
        """Turns and moves the waiting character towards a target, by one time step of ``seconds``."""
        now = self._standing
        difference = math.remainder(yaw - now.yaw, 2 * math.pi)
        turned = now.yaw + difference * -math.expm1(-seconds / _TURN_TIME_S)
        gain = -math.expm1(-seconds / _SIZE_TIME_S)
        self._standing = WaitingPlace(place, turned, now.height + gain * (height - now.height))

    def show(
        self,
        character: Character,
        driven: SceneCharacter | None,
        source: str,
        seconds: float,
        performer: Place | None = None,
    ) -> SceneCharacter:
        """Returns the character in this frame.

        Args:
            driven: the pose that a performer or a recording gives it; None while it waits.
            source: name of the performer or recording. After a change, the figure blends to the new source.
            performer: point of the floor where its performer stands. The blend starts once the character is
                there.
        """
        standing = stand_character(character, self._standing)
        if driven is not None and source != self._source and performer is not None:
            self._delayed_s += seconds
            if not self._is_near(standing, driven, performer) and self._delayed_s < _MAX_DELAY_S:
                driven, source = None, self._source
        else:
            self._delayed_s = 0.0
        target = standing if driven is None else driven
        if source != self._source:
            self._source, self._passed_s, self._start = source, 0.0, self._shown
        self._passed_s += seconds
        fraction = min(self._passed_s / _PASSAGE_S, 1.0)
        if self._start is not None and fraction < 1.0 and is_same_mesh(self._start.character, character):
            target = blend_figures(self._start, target, fraction * fraction * (3 - 2 * fraction))
        else:
            self._start = None
        self._shown = target
        return target

    def _is_near(self, standing: SceneCharacter, driven: SceneCharacter, performer: Place) -> bool:
        """Returns True if a driven character is close to the position that it would have around its
        performer.
        """
        moved = driven.pose.positions.mean(0) - standing.pose.positions.mean(0)
        away = np.array(performer) - np.array(self._standing.place)
        return bool(np.linalg.norm(moved[[0, 2]] - away) < _NEAR_M)


def is_same_mesh(first: Character, second: Character) -> bool:
    """Returns True if two characters have the same mesh, so that their poses can be blended."""
    return first.id == second.id and first.pivots.shape == second.pivots.shape


def blend_figures(start: SceneCharacter, end: SceneCharacter, fraction: float) -> SceneCharacter:
    """Returns the interpolation between two poses of a character at ``fraction`` in 0..1."""
    pose = blend_poses(start.pose, end.pose, fraction, end.pose.time_ns)
    vertices: Float32 | None = end.vertices
    if start.vertices is not None and end.vertices is not None:
        blended = start.vertices + fraction * (end.vertices - start.vertices)
        vertices = np.asarray(blended, np.float32)
    return replace(end, pose=pose, vertices=vertices)
