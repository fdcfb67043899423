"""The second view. It shows the performer at the puppet's current time, with the same orientation as the
puppet.

A click on a joint pairs it with the selected control point. The performer stays in the centre and faces the
same direction as the mesh, so that both can be compared. The view turns with the stage's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Skeleton
from enliven.examples.performer import yaw_from_rotation
from enliven.modeling.puppet.edits import play_take
from enliven.skeletons.facing import find_facing, rotate_about_y
from enliven_viewer.language import later, tr
from enliven_viewer.render.camera import TURN_PER_PIXEL, OrbitCamera
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.example_edits import find_layer_number, with_joint
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.viewport.overlay import Point
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.studio.viewport.stage_character import find_joints

_FRAMING_MARGIN = 1.3
"""Framing margin: size of the view relative to the performer at rest, so that raised arms fit."""
_MAX_CACHED_FIGURES = 60
"""Maximum number of cached figures. The figures of the key-pose strip are needed in every frame."""


@dataclass(frozen=True, eq=False)
class PerformerFigure:
    """The joints of the performer at one time.

    Attributes:
        skeleton: skeleton of the take.
        joints: (N, 3) metres, standing on the floor at the origin.
        height: height of the skeleton at rest in metres.
    """

    skeleton: Skeleton
    joints: Float
    height: float


class PerformerView:
    """The second view, which shows the performer with its own camera.

    Attributes:
        linked: True if the view turns with the stage's view.
        size: width and height in pixels.
        hovered: the joint under the pointer, or None.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.camera = OrbitCamera(editor.settings.render.opening)
        self.size: tuple[float, float] = (340.0, 420.0)
        self.linked = True
        self.hovered: int | None = None
        self._take: str | None = None
        self._framed_subject: tuple[object, ...] = ()
        self._facing: tuple[Skeleton, float] | None = None
        self._last_pixel: Point | None = None
        self._figures: dict[tuple[str, int], tuple[Clip, PerformerFigure]] = {}

    @property
    def take(self) -> str | None:
        """Returns the id of the shown take: the take of the edited key pose, the take of the layer, or the
        chosen take.
        """
        editor = self.editor
        key, puppet = get_puppet_editor(editor).key, get_puppet_editor(editor).puppet
        if key is not None:
            return key.take
        if self._take in editor.project.takes:
            return self._take
        number = None if puppet is None else find_layer_number(puppet, editor.selection.layer)
        return puppet.layers[number].take if puppet is not None and number is not None else None

    @property
    def moment(self) -> tuple[str, float] | None:
        """Returns the shown take and the time in it."""
        editor, take = self.editor, self.take
        if take is None or take not in editor.project.takes:
            return None
        key = get_puppet_editor(editor).key
        return (key.take, key.time) if key is not None else (take, self.playhead(take))

    @property
    def lens(self) -> Lens:
        """Returns the camera with the view's size."""
        return Lens(self.camera.view(self.size[0] / max(self.size[1], 1.0)), self.size)

    def playhead(self, take: str) -> float:
        """Returns the time in a take at the project's time, regardless of an edited key pose."""
        editor, puppet = self.editor, get_puppet_editor(self.editor).puppet
        number = None if puppet is None else find_layer_number(puppet, editor.selection.layer, take)
        if puppet is not None and number is not None:
            return puppet.layers[number].find_played_time(editor.time, editor.project.takes[take].duration)[0]
        return min(editor.time, editor.project.takes[take].duration)

    def show(self, take: str) -> None:
        """Shows a take. A puppet without layers also plays it from now on."""
        self._take = take
        puppet = get_puppet_editor(self.editor).puppet
        if puppet is None:
            return
        number = find_layer_number(puppet, None, take)
        if number is not None:
            self.editor.select(layer=number)
        elif not puppet.layers:
            self.play()

    def play(self) -> None:
        """Adds the shown take to the puppet as another layer."""
        puppet, take = get_puppet_editor(self.editor).puppet, self.take
        if puppet is not None and take is not None:
            name = puppet.id
            if self.editor.edit(
                later("{0} plays {1}", name, take), lambda project: play_take(project, name, take)
            ):
                self.editor.select(layer=len(puppet.layers))

    def update(self) -> None:
        """Prepares a frame: turns with the stage's view, frames the performer, and passes the shown moment to
        the puppets.
        """
        get_puppet_editor(self.editor).moment = self.moment
        figure = self.figure()
        if figure is None:
            return
        aspect = self.size[0] / max(self.size[1], 1.0)
        framed = (figure.skeleton, aspect)
        if self._framed_subject != framed:
            self._framed_subject = framed
            half, height = 0.42 * figure.height, 1.06 * figure.height
            box = np.array([-half, 0.0, -half]), np.array([half, height, half])
            self.camera.frame(box, aspect, at_once=True, reset=True, margin=_FRAMING_MARGIN)
        if self.linked:
            viewing_direction = self.editor.lens.forward
            self.camera.face(
                math.atan2(-viewing_direction[0], -viewing_direction[2]),
                math.asin(float(np.clip(-viewing_direction[1], -1.0, 1.0))),
            )
            self.camera.advance(10.0)

    def figure(self, moment: tuple[str, float] | None = None) -> PerformerFigure | None:
        """Returns the performer at a moment (id of the take, seconds), by default the shown moment. Returns
        None if no moment is shown.
        """
        moment = moment or self.moment
        if moment is None:
            return None
        clip = self.editor.project.takes[moment[0]]
        frame = int(np.clip(round(moment[1] / clip.step), 0, len(clip.turns) - 1))
        cached = self._figures.get((moment[0], frame))
        if cached is None or cached[0] is not clip:
            cached = (clip, self._make_figure(clip, frame))
            self._figures = {
                **dict(list(self._figures.items())[-_MAX_CACHED_FIGURES:]),
                (moment[0], frame): cached,
            }
        return cached[1]

    def _make_figure(self, clip: Clip, frame: int) -> PerformerFigure:
        joints = find_joints(clip.skeleton, clip.turns[frame], clip.root[frame])
        joints = joints - clip.root[frame] * [1.0, 0.0, 1.0]
        # Turn the performer into the direction of the mesh: remove the performer's yaw and the facing
        # direction of its rest pose.
        back = -float(yaw_from_rotation(clip.turns[frame, 0])) - self._find_front_yaw(clip)
        height = float(np.ptp(clip.skeleton.positions[:, 1]))
        return PerformerFigure(clip.skeleton, rotate_about_y(joints, np.asarray(back)), max(height, 0.05))

    def paired(self) -> dict[int, int]:
        """Returns the number of the control point for each paired joint of the performer."""
        puppet, moment = get_puppet_editor(self.editor).puppet, self.moment
        if puppet is None or moment is None:
            return {}
        names = {name: k for k, name in enumerate(self.editor.project.takes[moment[0]].skeleton.names)}
        return {names[point.joint]: k for k, point in enumerate(puppet.points) if point.joint in names}

    def press(self, pixel: Point) -> None:
        """Pairs the clicked joint with the selected control point, or begins to turn the view."""
        joint, figure = self.joint_at(pixel), self.figure()
        self._last_pixel = pixel if joint is None else None
        if joint is not None and figure is not None:
            self.pair(figure.skeleton.names[joint])

    def pair(self, joint: str) -> None:
        """Pairs a joint with the selected control point. Without a selected point, selects the control point
        that is paired with the joint.
        """
        editor = self.editor
        puppet, number = get_puppet_editor(editor).puppet, get_puppet_editor(editor).point
        if puppet is None:
            return
        if number is None:
            for k, point in enumerate(puppet.points):
                if point.joint == joint:
                    editor.select_only(puppet.id, k)
                    return
            editor.toasts.show_message(
                tr("No control point is chosen"), tr("Click a control point on the puppet, then the joint.")
            )
            return
        name, chosen = puppet.id, puppet.points[number]
        if chosen.joint != joint:
            editor.edit(
                later("pair {0}", chosen.name), lambda project: with_joint(project, name, chosen.name, joint)
            )

    def move(self, pixel: Point) -> None:
        """Highlights the joint under the pointer, or turns the view (and the stage with it)."""
        if self._last_pixel is None:
            self.hovered = self.joint_at(pixel)
            return
        across, down = pixel[0] - self._last_pixel[0], pixel[1] - self._last_pixel[1]
        turned = self.editor.camera if self.linked else self.camera
        turned.orbit(-TURN_PER_PIXEL * across, TURN_PER_PIXEL * down)
        if not self.linked:
            self.camera.advance(10.0)
        self._last_pixel = pixel

    def release(self) -> None:
        """Handles the release of the button."""
        self._last_pixel = None

    def wheel(self, up: float) -> None:
        """Zooms in or out."""
        self.camera.zoom(0.88**up)
        self.camera.advance(10.0)

    def joint_at(self, pixel: Point) -> int | None:
        """Returns the joint within reach of a pixel.

        Among coincident joints, returns the joint nearest to the root.
        """
        figure = self.figure()
        if figure is None:
            return None
        pixels, depth = self.lens.project(figure.joints)
        distances = np.linalg.norm(pixels - pixel, axis=1)
        near_joints = [k for k in range(len(distances)) if distances[k] <= self.editor.settings.reach]
        return min(
            near_joints,
            key=lambda k: (round(float(distances[k]) / 3.0), round(float(depth[k]), 2), k),
            default=None,
        )

    def _find_front_yaw(self, clip: Clip) -> float:
        """Returns the yaw of the performer's rest pose in radians."""
        if self._facing is None or self._facing[0] is not clip.skeleton:
            self._facing = (clip.skeleton, find_facing(clip.skeleton))
        return self._facing[1]
