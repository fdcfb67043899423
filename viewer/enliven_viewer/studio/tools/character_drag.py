"""Drags of whole characters: move, turn in place, or merge with another."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float
from enliven.document import Project
from enliven.modeling.edits import (
    get_rig_edits,
    key_characters,
    merge_characters,
    move_characters,
    root_motion,
)
from enliven.rotation import IDENTITY, from_rotation_vector
from enliven_viewer.language import later
from enliven_viewer.playback.document import find_bounds
from enliven_viewer.render.renderer import EMPTY_BOX
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.tools.base import Pointer
from enliven_viewer.studio.viewport.picking import Hit

_ROTATION_PER_PIXEL = 0.01
"""Rotation in radians per pixel."""
_PIVOT_RADIUS_PX = 24.0
"""A drag that starts closer to the pivot than this, in pixels, turns the character by sideways movement
instead of movement around the pivot.
"""
_UP_AXIS = np.array([0.0, 1.0, 0.0])


class CharacterDrag:
    """A drag of a character by a handle or by a point on its surface.

    Attributes:
        character: id of the dragged character.
        characters: ids of all characters that move: the selection if it contains the dragged character.
        rooted: True if its first handle (the root) is visible and follows the pointer.
        handles: (H, 3) positions of its handles at the start of the drag, in metres of the world.
    """

    def __init__(self, editor: Editor, hit: Hit, start: Pointer) -> None:
        posed = editor.stage_character(hit.character)
        self.editor, self.character, self._start_pointer = editor, hit.character, start
        self.handles = posed.handles
        self.rooted = len(posed.handles) > 0 and not posed.has_own_tool
        # Move the root in a plane parallel to the image, regardless of the grabbed part.
        self._grabbed_point = (
            posed.handles[0] if self.rooted else editor.lens.view.eye + hit.depth * editor.lens.ray(start.at)
        )
        character, project = posed.character, editor.project
        centre = get_rig_edits(character).centre(character)
        stands = root_motion(project, project.character(hit.character), editor.time)(centre[None])[0]
        self._pivot = self._grabbed_point if self.rooted else stands
        editor.selection = editor.selection.with_active(hit.character)
        editor.select(handle=max(hit.handle, 0) if self.rooted else None, chain=())
        self.characters = editor.selection.characters
        self._standing_point = _find_standing_point(editor, self.characters)
        editor.playing = False

    @property
    def has_several(self) -> bool:
        """Returns True if more than one character is dragged."""
        return len(self.characters) > 1

    @property
    def description(self) -> str:
        """Returns a description of the dragged characters, for the name of an edit."""
        return later("{0} shapes", len(self.characters)) if self.has_several else self.character

    def move(self, project: Project, pointer: Pointer) -> Project:
        """Returns the project with the characters moved by the pointer's movement."""
        lens = self.editor.lens
        offset = lens.intersect_plane(pointer.at, self._grabbed_point) - lens.intersect_plane(
            self._start_pointer.at, self._grabbed_point
        )
        if self.editor.snapping.is_active(pointer.ctrl):
            offset = self.editor.snapping.snap_offset(self._standing_point, offset)
        return self._move_characters(project, offset)

    def turn(self, project: Project, pointer: Pointer) -> Project:
        """Returns the project with the characters turned in the image plane.

        The angle is the pointer's movement around the root.

        With Shift, or without a visible root, sideways pointer movement turns them about the vertical axis.
        """
        turn = from_rotation_vector(self._find_rotation(pointer))
        return self._move_characters(project, np.zeros(3), turn, self._pivot)

    def _move_characters(
        self, project: Project, offset: Float, turn: Float = IDENTITY, pivot: Float | None = None
    ) -> Project:
        """Returns the project with the characters moved at all times.

        In auto-key mode they get keys at the playhead instead.
        """
        centre = np.zeros(3) if pivot is None else pivot
        if self.editor.is_auto_key:
            return key_characters(project, self.characters, self.editor.time, offset, turn, centre)
        return move_characters(project, self.characters, offset, turn, centre)

    def merge(self, project: Project, host: Hit, notes: list[str]) -> Project:
        """Returns the project with the character merged into another.

        It is then attached to a handle of the other character, or to a point on one of its bones.
        """
        bone_fraction = host.along if host.handle > 0 and host.along < 1.0 else 1.0
        node = host.handle if host.handle >= 0 else None
        return merge_characters(
            project,
            host.character,
            self.character,
            self.editor.time,
            node=node,
            at=bone_fraction,
            notes=notes,
        )

    def _find_rotation(self, pointer: Pointer) -> Float:
        axis, radians = self._turn_characters(pointer)
        snapping = self.editor.snapping
        return axis * (snapping.snap_angle(radians) if snapping.is_active(pointer.ctrl) else radians)

    def _turn_characters(self, pointer: Pointer) -> tuple[Float, float]:
        """Returns the unit axis (3,) and the angle in radians of the rotation."""
        lens, start = self.editor.lens, self._start_pointer
        across = _ROTATION_PER_PIXEL * (pointer.at[0] - start.at[0])
        if pointer.shift or not self.rooted:
            return _UP_AXIS, across
        centre = lens.project(self._pivot[None])[0][0]
        start_arm, pointer_arm = (np.array(p.at) - centre for p in (start, pointer))
        if np.linalg.norm(start_arm) < _PIVOT_RADIUS_PX:
            return lens.forward, across
        return lens.forward, math.atan2(pointer_arm[1], pointer_arm[0]) - math.atan2(
            start_arm[1], start_arm[0]
        )


def _find_standing_point(editor: Editor, characters: tuple[str, ...]) -> Float:
    """Returns the horizontal centre (3,) in metres of the characters, at the height of their lowest point."""
    low, high = (
        find_bounds([character.extent for character in editor.stage_characters if character.id in characters])
        or EMPTY_BOX
    )
    return np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
