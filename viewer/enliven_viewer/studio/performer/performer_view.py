"""The second view: the performer at the moment that the puppet shows, turned as the puppet is.

A click on a joint pairs it with the chosen control point. The performer stays in the middle of the picture
and looks where the mesh looks, so that both can be compared; the view turns with the stage's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Skeleton
from enliven.examples import yaw_of
from enliven.mapping import facing_of, turned_about_y
from enliven.modeling.puppet import play_take
from enliven_viewer.language import later, tr
from enliven_viewer.render import DRAG_TURN, OrbitCamera
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.examples import layer_of, with_joint
from enliven_viewer.studio.viewport import Lens, Point, joints_of

_ROOM = 1.3
"""Size of the picture over that of the performer at rest: raised arms stay in it."""
_KEPT = 60
"""Figures that are kept: those of the strip are asked for in every picture."""


@dataclass(frozen=True, eq=False)
class PerformerFigure:
    """The joints of the performer at one moment.

    Attributes:
        skeleton: the take's.
        joints: (N, 3) metres, above the floor at the origin.
        height: metres, of the skeleton at rest.
    """

    skeleton: Skeleton
    joints: Float
    height: float


class PerformerView:
    """The second view: the performer, seen by a camera of its own.

    Attributes:
        linked: whether it turns with the stage.
        size: pixels.
        hovered: the joint under the pointer, or None.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.camera = OrbitCamera(editor.settings.render.opening)
        self.size: tuple[float, float] = (340.0, 420.0)
        self.linked = True
        self.hovered: int | None = None
        self._take: str | None = None
        self._framed: tuple[object, ...] = ()
        self._facing: tuple[Skeleton, float] | None = None
        self._last: Point | None = None
        self._figures: dict[tuple[str, int], tuple[Clip, PerformerFigure]] = {}

    @property
    def take(self) -> str | None:
        """Returns the id of the take that is shown: of the key pose that is edited, of the layer, or as
        chosen.
        """
        editor = self.editor
        key, puppet = editor.puppets.key, editor.puppets.puppet
        if key is not None:
            return key.take
        if self._take in editor.project.takes:
            return self._take
        number = None if puppet is None else layer_of(puppet, editor.selection.layer)
        return puppet.layers[number].take if puppet is not None and number is not None else None

    @property
    def moment(self) -> tuple[str, float] | None:
        """Returns the take and the second of it that are shown."""
        editor, take = self.editor, self.take
        if take is None or take not in editor.project.takes:
            return None
        key = editor.puppets.key
        return (key.take, key.time) if key is not None else (take, self.playhead(take))

    @property
    def lens(self) -> Lens:
        """Returns the camera and the view's size."""
        return Lens(self.camera.view(self.size[0] / max(self.size[1], 1.0)), self.size)

    def playhead(self, take: str) -> float:
        """Returns the second of a take at the project's time, whatever key pose is edited."""
        editor, puppet = self.editor, self.editor.puppets.puppet
        number = None if puppet is None else layer_of(puppet, editor.selection.layer, take)
        if puppet is not None and number is not None:
            return puppet.layers[number].played(editor.time, editor.project.takes[take].duration)[0]
        return min(editor.time, editor.project.takes[take].duration)

    def show(self, take: str) -> None:
        """Shows a take; a puppet that plays nothing yet plays it from now on."""
        self._take = take
        puppet = self.editor.puppets.puppet
        if puppet is None:
            return
        number = layer_of(puppet, None, take)
        if number is not None:
            self.editor.select(layer=number)
        elif not puppet.layers:
            self.play()

    def play(self) -> None:
        """Lets the puppet play the take that is shown, as a layer more."""
        puppet, take = self.editor.puppets.puppet, self.take
        if puppet is not None and take is not None:
            name = puppet.id
            if self.editor.edit(
                later("{0} plays {1}", name, take), lambda project: play_take(project, name, take)
            ):
                self.editor.select(layer=len(puppet.layers))

    def follow(self) -> None:
        """Prepares a picture: turn with the stage, frame the performer, and tells the puppets the moment."""
        self.editor.puppets.moment = self.moment
        figure = self.figure()
        if figure is None:
            return
        aspect = self.size[0] / max(self.size[1], 1.0)
        framed = (figure.skeleton, aspect)
        if self._framed != framed:
            self._framed = framed
            half, tall = 0.42 * figure.height, 1.06 * figure.height
            box = np.array([-half, 0.0, -half]), np.array([half, tall, half])
            self.camera.frame(box, aspect, at_once=True, reset=True, room=_ROOM)
        if self.linked:
            way = self.editor.lens.forward
            self.camera.face(math.atan2(-way[0], -way[2]), math.asin(float(np.clip(-way[1], -1.0, 1.0))))
            self.camera.advance(10.0)

    def figure(self, moment: tuple[str, float] | None = None) -> PerformerFigure | None:
        """Returns the performer at a moment, or at the one that is shown."""
        moment = moment or self.moment
        if moment is None:
            return None
        clip = self.editor.project.takes[moment[0]]
        frame = int(np.clip(round(moment[1] / clip.step), 0, len(clip.turns) - 1))
        known = self._figures.get((moment[0], frame))
        if known is None or known[0] is not clip:
            known = (clip, self._made(clip, frame))
            self._figures = {**dict(list(self._figures.items())[-_KEPT:]), (moment[0], frame): known}
        return known[1]

    def _made(self, clip: Clip, frame: int) -> PerformerFigure:
        joints = joints_of(clip.skeleton, clip.turns[frame], clip.root[frame])
        joints = joints - clip.root[frame] * [1.0, 0.0, 1.0]
        # As the mesh looks: without the performer's own yaw, and without where its rest pose looks.
        back = -float(yaw_of(clip.turns[frame, 0])) - self._front_turn(clip)
        height = float(np.ptp(clip.skeleton.positions[:, 1]))
        return PerformerFigure(clip.skeleton, turned_about_y(joints, np.asarray(back)), max(height, 0.05))

    def paired(self) -> dict[int, int]:
        """For joints of the performer that are paired, the number of the control point."""
        puppet, moment = self.editor.puppets.puppet, self.moment
        if puppet is None or moment is None:
            return {}
        names = {name: k for k, name in enumerate(self.editor.project.takes[moment[0]].skeleton.names)}
        return {names[point.joint]: k for k, point in enumerate(puppet.points) if point.joint in names}

    def press(self, at: Point) -> None:
        """Pairs the joint that is clicked with the chosen control point; or begin to turn the view."""
        joint, figure = self.joint_at(at), self.figure()
        self._last = at if joint is None else None
        if joint is not None and figure is not None:
            self.pair(figure.skeleton.names[joint])

    def pair(self, joint: str) -> None:
        """Pairs a joint with the chosen control point; one that is paired already chooses its point."""
        editor = self.editor
        puppet, number = editor.puppets.puppet, editor.puppets.point
        if puppet is None:
            return
        if number is None:
            for k, point in enumerate(puppet.points):
                if point.joint == joint:
                    editor.choose(puppet.id, k)
                    return
            editor.toasts.say(
                tr("No control point is chosen"), tr("Click one on the puppet, then the joint.")
            )
            return
        name, chosen = puppet.id, puppet.points[number]
        if chosen.joint != joint:
            editor.edit(
                later("pair {0}", chosen.name), lambda project: with_joint(project, name, chosen.name, joint)
            )

    def move(self, at: Point) -> None:
        """Lights what is under the pointer, or turns the view (and the stage with it)."""
        if self._last is None:
            self.hovered = self.joint_at(at)
            return
        across, down = at[0] - self._last[0], at[1] - self._last[1]
        turned = self.editor.camera if self.linked else self.camera
        turned.orbit(-DRAG_TURN * across, DRAG_TURN * down)
        if not self.linked:
            self.camera.advance(10.0)
        self._last = at

    def release(self) -> None:
        """The button went up."""
        self._last = None

    def wheel(self, up: float) -> None:
        """Closer, or further."""
        self.camera.zoom(0.88**up)
        self.camera.advance(10.0)

    def joint_at(self, at: Point) -> int | None:
        """Returns the joint within reach of a pixel; of those at one place the one that is nearest to the
        root.
        """
        figure = self.figure()
        if figure is None:
            return None
        pixels, depth = self.lens.project(figure.joints)
        away = np.linalg.norm(pixels - at, axis=1)
        near = [k for k in range(len(away)) if away[k] <= self.editor.settings.reach]
        return min(
            near, key=lambda k: (round(float(away[k]) / 3.0), round(float(depth[k]), 2), k), default=None
        )

    def _front_turn(self, clip: Clip) -> float:
        """Returns radians that the performer's front is turned at rest."""
        if self._facing is None or self._facing[0] is not clip.skeleton:
            self._facing = (clip.skeleton, facing_of(clip.skeleton))
        return self._facing[1]
