"""Which puppet, control point and key pose are worked on, and what a drag does to them.

desk = editor.puppets
desk.begin_pose("walk", 0.4)        # a new key pose for that moment of a take, or the one that is there
desk.drag(2, place)                 # the surface follows; nothing is remembered yet
desk.drop()                         # one edit of the project
desk.accept()                       # the puppet plays again

Everything that is finished is an edit at once, so that undo, the recovery file and all panels see it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.examples.puppet_motion import State
from enliven.modeling.puppets import (
    add_key_pose,
    add_point,
    change_key_pose,
    remove_key_pose,
    remove_point,
)
from enliven.motion.clip import Clip
from enliven.project import Project
from enliven.puppet import KeyPose, Puppet
from enliven_viewer.studio.puppets.crossing import Crossing
from enliven_viewer.studio.puppets.kept import middle_of, size_of
from enliven_viewer.studio.puppets.mirrored import mirrored_places, partner_vertex, plane_for
from enliven_viewer.studio.puppets.playing import take_places
from enliven_viewer.studio.puppets.solver import LARGE
from enliven_viewer.studio.puppets.stage import PuppetStage, Standing

if TYPE_CHECKING:
    from enliven_viewer.studio.editor import Editor

_MANY = 200_000
"""Faces."""
_MOST_AWAY = 50.0
"""Sizes of the mesh beyond which a control point is not dragged: farther is a slip of the hand."""


class PuppetDesk:
    """The state that the stage and the example panel share.

    Attributes:
        moment: the take and the second of it that the performer's view shows; a drag begins a key pose
            there. None: of the lowest layer, at the project's time.
        symmetric: whether control points are put and dragged with their mirror image.
        silhouette: whether the key pose before is outlined while one is edited.
        warn: whether faces that pass through one another are shown.
        way: how the puppet stood when the key pose was begun: there it stays while it is edited.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor
        self.moment: tuple[str, float] | None = None
        self.symmetric, self.silhouette, self.warn = False, True, True
        self._key: tuple[str, int] | None = None
        self._before: Float | None = None
        self._dragged: Float | None = None
        self.way: State | None = None
        self.stage = PuppetStage(editor, self)
        self.crossing = Crossing()
        self._at = 0.0

    def advance(self) -> None:
        """A picture went by: surfaces come to rest; playing on leaves the key pose."""
        if self.posing and (self.editor.playing or abs(self.editor.time - self._at) > 1e-9):
            self.accept()
        self.stage.improve()
        standing = self.stage.standing_of(self.puppet.id) if self.puppet is not None else None
        if standing is not None and self.dragging and len(standing.puppet.mesh.faces) > _MANY:
            return  # so many are looked at when the drag is over
        if self.warn and self.shaping and standing is not None:
            self.crossing.look(standing.puppet, standing.surface)
        else:
            self.crossing.forget()

    @property
    def shaping(self) -> bool:
        """Whether a key pose is edited, or a control point dragged."""
        return self.posing or self.dragging

    @property
    def standing(self) -> tuple[Standing, ...]:
        """Every puppet as it is shown now."""
        return self.stage.standing

    @property
    def puppet(self) -> Puppet | None:
        """The chosen puppet."""
        return self.editor.project.puppets.get(self.editor.selection.puppet or "")

    @property
    def point(self) -> int | None:
        """The number of the chosen control point."""
        chosen, puppet = self.editor.selection.point, self.puppet
        return chosen if puppet is not None and chosen is not None and chosen < len(puppet.points) else None

    def choose(self, puppet: str | None, point: int | None = None) -> None:
        """Choose a puppet, and perhaps a control point of it."""
        self.editor.select(puppet=puppet)
        self.editor.select(point=point, puppet_layer=None)

    @property
    def number(self) -> int | None:
        """The number of the key pose that is edited; None while the puppet plays."""
        puppet = self.puppet
        if self._key is None or puppet is None or self._key[0] != puppet.id:
            return None
        return self._key[1] if self._key[1] < len(puppet.poses) else None

    @property
    def posing(self) -> bool:
        """Whether a key pose is edited."""
        return self.number is not None

    @property
    def key(self) -> KeyPose | None:
        """The key pose that is edited."""
        puppet, number = self.puppet, self.number
        return puppet.poses[number] if puppet is not None and number is not None else None

    @property
    def previous(self) -> KeyPose | None:
        """The key pose before the one that is edited, to compare with; of the first the one after it."""
        puppet, number = self.puppet, self.number
        if puppet is None or number is None or len(puppet.poses) < 2:
            return None
        return puppet.poses[number - 1 if number else 1]

    @property
    def places(self) -> Float | None:
        """(P, 3) metres in the mesh's frame: as dragged, or of the key pose; None while the puppet plays."""
        if self._dragged is not None:
            return self._dragged
        return None if self.key is None else self.key.places

    @property
    def dragging(self) -> bool:
        """Whether a control point is dragged."""
        return self._dragged is not None

    def begin_pose(self, take: str, time: float) -> bool:
        """Make a key pose for a take's second, as the puppet is then; one that is there already is edited."""
        puppet = self._wanted()
        if puppet is None:
            return False
        there = self.pose_at(take, time)
        if there is not None:
            return self.edit_pose(there)
        return self._add(puppet, take, time, take_places(self.editor.project, puppet, take, time))

    def pose_at(self, take: str, time: float) -> int | None:
        """The number of the chosen puppet's key pose of a frame of a take, or None."""
        puppet, clip = self.puppet, self.editor.project.takes.get(take)
        if puppet is None or clip is None:
            return None
        near = [
            n
            for n, pose in enumerate(puppet.poses)
            if pose.take == take and _same_frame(clip, pose.time, time)
        ]
        return near[0] if near else None

    def edit_pose(self, number: int) -> bool:
        """Edit a key pose that is there."""
        puppet = self._wanted()
        if puppet is None or not 0 <= number < len(puppet.poses):
            return False
        self._edit(puppet.id, number, puppet.poses[number].places, self.stage.standing_of(puppet.id))
        return True

    def accept(self) -> None:
        """Leave the key pose as it is; the puppet plays again."""
        self._key = self._before = self._dragged = self.way = None

    def cancel(self) -> None:
        """Put the key pose back as it was before it was edited, or away where it is new."""
        puppet, number, before = self.puppet, self.number, self._before
        self.accept()
        if puppet is None or number is None:
            return
        if before is None:
            self.editor.edit("drop the key pose", lambda p: remove_key_pose(p, puppet.id, number))
        elif len(before) == len(puppet.points) and not np.array_equal(before, puppet.poses[number].places):
            self.editor.edit(
                "drop the changes", lambda p: change_key_pose(p, puppet.id, number, places=before)
            )

    def drag(self, point: int, place: Float) -> None:
        """Show a control point at a place (3,) of the mesh's frame; with symmetry its partner follows."""
        puppet = self.puppet
        if puppet is None or not 0 <= point < len(puppet.points):
            return
        places = np.array(self._start(puppet))
        places[point] = _near(puppet, np.asarray(place, np.float64))
        if self.symmetric:
            places = mirrored_places(puppet, places, point)
        self._dragged = places

    def drop(self, name: str = "") -> bool:
        """Keep what was dragged: one edit. Where no key pose is edited, one begins at :attr:`moment`."""
        puppet, places, self._dragged = self.puppet, self._dragged, None
        if puppet is None or places is None:
            return False
        if self.number is None:
            return self._begin_here(puppet, places)
        number = self.number
        return self.editor.edit(
            name or "pose", lambda p: change_key_pose(p, puppet.id, number, places=places)
        )

    def let_go(self) -> None:
        """Forget what is dragged."""
        self._dragged = None

    def nudge(self, way: Float) -> bool:
        """Move the chosen control point by (3,) metres of the mesh's frame, or its mirror image too."""
        puppet, point = self.puppet, self.point
        if puppet is None or point is None:
            return False
        self.drag(point, self._start(puppet)[point] + way)
        return self.drop(f"nudge {puppet.points[point].name}")

    def reset_point(self) -> bool:
        """Put the chosen control point where it is at rest."""
        puppet, point = self.puppet, self.point
        if puppet is None or point is None:
            return False
        self.drag(point, puppet.rest[point])
        return self.drop(f"reset {puppet.points[point].name}")

    def add_point(self, vertex: int) -> bool:
        """Put a control point on a vertex, with symmetry on its mirror image too; one edit."""
        puppet = self._wanted()
        if puppet is None:
            return False
        taken = [point.vertex for point in puppet.points]
        if vertex in taken:
            self.choose(puppet.id, taken.index(vertex))
            self.editor.toasts.say(f"{puppet.points[taken.index(vertex)].name} is there already")
            return False
        other = partner_vertex(puppet, vertex) if self.symmetric else None
        wanted = [vertex] if other is None or other in (vertex, *taken) else [vertex, other]

        poses = self.stage.surfaces.settled(puppet, [pose.places for pose in puppet.poses])
        if poses is None and len(puppet.mesh.vertices) > LARGE:
            self.editor.toasts.say(f"{puppet.id} is still being prepared", "Click again in a moment.")
            return False

        def change(project: Project) -> Project:
            for one in wanted:
                places = None if poses is None else np.array([pose[one] for pose in poses]).reshape(-1, 3)
                project = add_point(project, puppet.id, one, places=places)
            return project

        if not self.editor.edit("put a control point" + "s" * (len(wanted) - 1), change):
            return False
        self.choose(puppet.id, len(taken))
        return True

    def remove_point(self) -> bool:
        """Take the chosen control point away, also from all key poses; one edit."""
        puppet, point = self.puppet, self.point
        if puppet is None or point is None:
            return False
        name, used = puppet.points[point].name, len(puppet.poses)
        if not self.editor.edit(f"remove {name}", lambda p: remove_point(p, puppet.id, name)):
            return False
        self._before = None if self._before is None else np.delete(self._before, point, axis=0)
        self.editor.select(point=None)
        if used:
            self.editor.toasts.say(
                f"{name} is gone, also from {used} key pose{'s' * (used > 1)}", "Ctrl+Z brings it back."
            )
        return True

    def set_symmetric(self, on: bool) -> None:
        """Turn symmetric control points on or off; a mesh without a plane of symmetry says so."""
        puppet = self.puppet
        self.symmetric = on
        if on and puppet is not None and plane_for(puppet) is None:
            self.symmetric = False
            self.editor.toasts.say(
                f"{puppet.id} has no plane of symmetry", "Put and drag its control points one by one."
            )

    def _edit(self, puppet: str, number: int, before: Float | None, standing: Standing | None) -> None:
        self.way = standing.state if standing is not None and self.way is None else self.way
        self._key, self._before, self._dragged = (puppet, number), before, None
        self.editor.playing, self._at = False, self.editor.time

    def _start(self, puppet: Puppet) -> Float:
        """(P, 3) what a drag starts from."""
        places = self.places
        return places if places is not None else self.shown(puppet)

    def shown(self, puppet: Puppet) -> Float:
        """(P, 3) metres in the mesh's frame, where its control points are now on the stage."""
        standing = self.stage.standing_of(puppet.id)
        return puppet.rest if standing is None else standing.state.places

    def _begin_here(self, puppet: Puppet, places: Float) -> bool:
        """Make what was dragged the key pose of the moment that the performer's view shows."""
        moment = self.moment
        if moment is None and puppet.layers:
            layer = puppet.layers[0]
            length = self.editor.project.takes[layer.take].duration
            moment = (layer.take, min(max((self.editor.time - layer.offset) * layer.speed, 0.0), length))
        if moment is None or moment[0] not in self.editor.project.takes:
            self.editor.toasts.say(
                "No take is shown, so this pose means nothing yet",
                "Choose a take in the performer's view, go to a moment of it, and drag again.",
            )
            return False
        there = self.pose_at(*moment)
        if there is None:
            return self._add(puppet, *moment, places)
        self.edit_pose(there)
        return self.editor.edit("pose", lambda p: change_key_pose(p, puppet.id, there, places=places))

    def _add(self, puppet: Puppet, take: str, time: float, places: Float) -> bool:
        """A key pose more, which is edited from now on; one edit."""
        if not puppet.points:
            self.editor.toasts.say("It has no control points yet", "Click the mesh where it is to be held.")
            return False
        standing = self.stage.standing_of(puppet.id)

        def adding(project: Project) -> Project:
            return add_key_pose(project, puppet.id, take, time, places)

        if not self.editor.edit(f"add key pose {len(puppet.poses) + 1}", adding):
            return False
        self._edit(puppet.id, len(puppet.poses), None, standing)
        return True

    def _wanted(self) -> Puppet | None:
        if self.puppet is None:
            self.editor.toasts.say("No puppet is chosen", "Click one first.")
        return self.puppet


def _same_frame(clip: Clip, a: float, b: float) -> bool:
    return round(a / clip.step) == round(b / clip.step)


def _near(puppet: Puppet, place: Float) -> Float:
    """The place (3,), or the farthest on its way from rest that is no slip of the hand."""
    middle, most = middle_of(puppet.mesh), _MOST_AWAY * size_of(puppet.mesh)
    way = place - middle
    away = float(np.linalg.norm(way))
    if not np.isfinite(away):
        raise InputError("the control point is dragged to no place", where=f"puppet {puppet.id!r}")
    return place if away <= most else middle + way * (most / away)
