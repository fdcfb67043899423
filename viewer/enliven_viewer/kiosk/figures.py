"""The figure of a character in the picture: it stands, turns to visitors, and passes over smoothly."""

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
"""Largest height in metres at which puppets and rigged models wait in their own size."""
_TURN_TIME_S = 0.12
"""Time constant of a character's turn to a visitor, in seconds. After 0.3 s, 92 % of the turn is
done."""
_SIZE_TIME_S = 0.5
"""Time constant of the size as it follows the visitor's height, in seconds."""
_NEAR_M = 0.25
"""Distance in metres between a driven character and its performer below which the figure may pass over. The
edge moves a character to its performer within half a second; until then the figure waits on the spot."""
_MAX_DELAY_S = 1.0
"""Longest time for which the figure waits for that, in seconds. Some characters stand next to performers."""
_PASSAGE_S = 0.5
"""Duration of the passage from one source of the pose to another in seconds, such as the start of a hold."""


@dataclass(frozen=True)
class WaitingPlace:
    """Where and how a waiting character stands.

    Attributes:
        place: point of the floor (x, z) in metres.
        yaw: radians about +Y from +Z to the character's front.
        height: metres. Puppets and rigged models keep their own height.
        size: factor on the size.
    """

    place: Place
    yaw: float = 0.0
    height: float = STANDING_HEIGHT_M
    size: float = 1.0


def stand_character(character: Character, standing: WaitingPlace) -> SceneCharacter:
    """Returns a character that stands at a place in its modelled shape."""
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
        place: where it waits.
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
        """Returns how it stands while it waits."""
        return self._standing

    def turn_to(self, place: Place, yaw: float, height: float, seconds: float) -> None:
        """Turns the waiting character and moves it, gently."""
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
            driven: its pose while a performer or a recording moves it; None while it waits.
            source: name of the performer or recording. After a change, the figure passes over to it.
            performer: where its performer stands. The figure passes over once the character is there.
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
        """Returns True if a driven character is where it would stand around its performer."""
        moved = driven.pose.positions.mean(0) - standing.pose.positions.mean(0)
        away = np.array(performer) - np.array(self._standing.place)
        return bool(np.linalg.norm(moved[[0, 2]] - away) < _NEAR_M)


def is_same_mesh(first: Character, second: Character) -> bool:
    """Returns True if the poses of two characters can be blended."""
    return first.id == second.id and first.pivots.shape == second.pivots.shape


def blend_figures(start: SceneCharacter, end: SceneCharacter, fraction: float) -> SceneCharacter:
    """Returns the figure at ``fraction`` in 0..1 between two poses of a character."""
    pose = blend_poses(start.pose, end.pose, fraction, end.pose.time_ns)
    vertices: Float32 | None = end.vertices
    if start.vertices is not None and end.vertices is not None:
        blended = start.vertices + fraction * (end.vertices - start.vertices)
        vertices = np.asarray(blended, np.float32)
    return replace(end, pose=pose, vertices=vertices)
