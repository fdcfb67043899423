"""The second view of the studio: the skeleton of a take, for choosing a chain."""

from __future__ import annotations

import numpy as np

from enliven.document import Clip, joint_places, still_shape
from enliven.motion.layers.evaluate import ShapePose, pose_from
from enliven_viewer.playback.document import find_bounds
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.viewport.overlay import Overlay, Point
from enliven_viewer.studio.viewport.picking import Hit, Lens, find_joint_at
from enliven_viewer.studio.viewport.selection import Selection
from enliven_viewer.studio.viewport.stage_character import StageCharacter

_ROTATION_PER_PIXEL = 0.01
"""Rotation in radians per pixel of a drag. It is more than on the stage, because the view is small."""
SOURCE_ID = "source"
"""Id of the shape that represents a take's skeleton."""


class SourceView:
    """A take's skeleton with its own camera, playing in sync with the project.

    Attributes:
        take: id of the shown take, or None.
        chain: the chosen joints, from the fixed end to the moving end.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.camera = OrbitCamera(editor.settings.render.opening)
        self.size: tuple[float, float] = (300.0, 240.0)
        self.take: str | None = None
        self.chain: tuple[int, ...] = ()
        self._chain_start: int | None = None
        self._hovered: Hit | None = None
        self._last_pixel: Point | None = None

    @property
    def clip(self) -> Clip | None:
        """Returns the take, or None."""
        return self.editor.project.takes.get(self.take or "")

    @property
    def lens(self) -> Lens:
        """Returns the camera with the view's size."""
        return Lens(self.camera.view(self.size[0] / max(self.size[1], 1.0)), self.size)

    def show(self, take: str) -> None:
        """Shows another take, and frames it completely."""
        self.take, self.chain, self._chain_start, self._hovered = take, (), None, None
        clip = self.clip
        if clip is None:
            return
        frames = range(0, len(clip.turns), max(len(clip.turns) // 12, 1))
        bounds = find_bounds([pose_take(clip, frame * clip.step).handles for frame in frames])
        if bounds is not None:
            aspect = self.size[0] / max(self.size[1], 1.0)
            self.camera.frame(
                (bounds[0] - 0.05, bounds[1] + 0.05), aspect, at_once=True, reset=True, margin=1.25
            )
            # Start with the front view, because a chain is mapped as it appears on the screen.
            self.camera.orbit(-0.56, 0.0)
            self.camera.advance(10.0)

    def make_posed_skeleton(self) -> StageCharacter | None:
        """Returns the take's skeleton at the project's time. The take is looped. While playback is stopped at
        time 0, returns its first frame.
        """
        clip = self.clip
        if clip is None:
            return None
        return pose_take(clip, self.editor.time % max(clip.duration, clip.step))

    def press(self, pixel: Point) -> None:
        """Chooses the joint at the start of a chain with the first click, and the joint at its end with the
        second.
        """
        hit = self._find_joint(pixel)
        clip = self.clip
        if hit is None or clip is None:
            self._last_pixel = pixel
        elif self._chain_start is None:
            self._chain_start, self.chain = hit.handle, (hit.handle,)
        else:
            self.chain = clip.skeleton.path(self._chain_start, hit.handle)
            self._chain_start = None

    def move(self, pixel: Point) -> None:
        """Highlights the joint under the pointer, or turns the view."""
        if self._last_pixel is not None:
            across, down = pixel[0] - self._last_pixel[0], pixel[1] - self._last_pixel[1]
            self.camera.orbit(-_ROTATION_PER_PIXEL * across, _ROTATION_PER_PIXEL * down)
            self._last_pixel = pixel
        else:
            self._hovered = self._find_joint(pixel)

    def release(self) -> None:
        """Handles the release of the button."""
        self._last_pixel = None

    def forget(self) -> None:
        """Clears the chosen chain."""
        self.chain, self._chain_start = (), None

    @property
    def is_choosing(self) -> bool:
        """Returns True if the start of a chain is chosen, but not its end."""
        return self._chain_start is not None

    @property
    def selection(self) -> Selection:
        """Returns the selection with the chosen joint, for drawing."""
        return Selection(SOURCE_ID, self._chain_start)

    def overlay(self) -> Overlay:
        """Returns the overlay with the chain and the hovered joint."""
        hovered = (SOURCE_ID, self._hovered.handle) if self._hovered else None
        return Overlay((), (SOURCE_ID, self.chain) if self.chain else None, hovered)

    def _find_joint(self, pixel: Point) -> Hit | None:
        posed = self.make_posed_skeleton()
        return find_joint_at([posed], self.lens, pixel, self.editor.settings.reach) if posed else None


def pose_take(clip: Clip, time: float) -> StageCharacter:
    """Returns a take's own skeleton at the frame nearest to ``time``, in seconds from its start."""
    frame = int(np.clip(round(time / clip.step), 0, len(clip.turns) - 1))
    frame_clip = clip.map_values(lambda track: track[frame : frame + 1])
    joints, shape = joint_places(frame_clip)[0], still_shape(SOURCE_ID, clip.skeleton)
    return StageCharacter(shape, None, pose_from(shape, ShapePose(clip.turns[frame], joints), time), joints)
