"""Edits the selected puppet: dragging its control points, and its key poses.

puppets = get_puppet_editor(editor)
puppets.begin_pose("walk", 0.4)        # adds a key pose at a time of a take, or opens an existing one
puppets.drag(2, place)                 # the surface follows; nothing is stored yet
puppets.drop()                         # one edit of the project
puppets.accept()                       # the puppet plays again

Every finished step is an edit, so that undo, the recovery file and all panels include it.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import ExampleCharacter, Project, RigBase
from enliven.modeling.puppet.points import remove_point
from enliven.modeling.puppet.poses import change_key_pose
from enliven_viewer.language import later, tr, tr_n
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.rig_editor import RigEditor
from enliven_viewer.studio.puppets.key_poses import KeyPoses
from enliven_viewer.studio.puppets.mesh_cache import find_mesh_centre, measure_mesh
from enliven_viewer.studio.puppets.motion_solver import MotionSolver
from enliven_viewer.studio.puppets.puppet_stage import PuppetStage, StagePuppet
from enliven_viewer.studio.puppets.self_intersection import SelfIntersectionSearch
from enliven_viewer.studio.puppets.symmetry import mirror_places

_LARGE_MESH_FACES = 200_000
"""In meshes with more faces than this, self-intersections are searched only after a drag, not during it."""
_MAX_DRAG_DISTANCE = 50.0
"""Maximum distance of a dragged control point from the mesh's centre, as a multiple of the mesh's size.
Larger distances are unintended.
"""


class PuppetEditor(KeyPoses, RigEditor):
    """The state of editing puppets, shared by the stage and the examples panel.

    Attributes:
        moment: the take and the time in seconds that the performer's view shows. A drag begins a key pose at
            this moment. None means the moment that the lowest layer plays.
        silhouette: True to outline the previous key pose while a key pose is edited.
        warn: whether self-intersecting faces are shown.
        motion_solver: solves the motions of puppets in the background.
    """

    def __init__(self, editor: Editor) -> None:
        self.motion_solver = MotionSolver(editor.toasts)
        super().__init__(editor, PuppetStage(editor, self))
        self.moment: tuple[str, float] | None = None
        self.silhouette, self.warn = True, True
        self.self_intersection = SelfIntersectionSearch()
        self._dragged: Float | None = None

    def advance(self) -> None:
        """Advances one frame, in which surfaces converge.

        Another time or another puppet ends the editing of a key pose.
        """
        self.leave_elsewhere()
        self.stage.improve()
        standing = self.stage_puppet
        if (
            standing is not None
            and self.is_dragging
            and len(standing.character.mesh.faces) > _LARGE_MESH_FACES
        ):
            return
        if self.warn and self.is_shaping and standing is not None:
            self.self_intersection.start_check(standing.character, standing.surface)
        else:
            self.self_intersection.forget()

    def stage_character(self, character: RigBase) -> StagePuppet:
        """Returns a puppet of the project in its current pose."""
        return self.stage.stage_puppet(character)

    def find_shown(self, project: Project, character_id: str) -> tuple[Project, RigBase]:
        """Returns a puppet with its newest solution, and the project that it belongs to."""
        return self.motion_solver.find_shown(project, character_id)

    def settle_motion(self, project: Project, character_id: str) -> None:
        """Waits until the motion of a puppet is solved."""
        self.motion_solver.settle(project, character_id)

    def settle_surfaces(self) -> None:
        """Solves surfaces again that were only solved coarsely while the playhead was dragged."""
        self.stage.surfaces.settle()

    @property
    def is_shaping(self) -> bool:
        """Returns True if a key pose is being edited or a control point dragged."""
        return self.is_posing or self.is_dragging

    @property
    def places(self) -> Float | None:
        """Returns the control points as dragged or from the key pose, (P, 3) in metres of the mesh's frame.

        Returns None while the puppet plays.
        """
        if self._dragged is not None:
            return self._dragged
        return None if self.key is None else self.key.places

    @property
    def is_dragging(self) -> bool:
        """Returns True if a control point is being dragged."""
        return self._dragged is not None

    def drag(self, point: int, place: Float) -> None:
        """Previews a control point at a position (3,) in metres of the mesh's frame. With symmetry, its
        mirror point moves too.
        """
        puppet, place = self.puppet, np.asarray(place, np.float64)
        if puppet is None or not 0 <= point < len(puppet.points) or not np.isfinite(place).all():
            return
        places = np.array(self._find_start_places(puppet))
        places[point] = _clamp_place(puppet, place)
        if self.symmetric:
            places = mirror_places(puppet, places, point)
        self._dragged = places

    def drop(self, name: str = "") -> bool:
        """Ends a drag with one edit. If no key pose is being edited, one begins at :attr:`moment`."""
        puppet, places, self._dragged = self.puppet, self._dragged, None
        if puppet is None or places is None:
            return False
        if self.number is None:
            return self._begin_here(puppet, places)
        number = self.number
        return self.editor.edit(
            name or "pose", lambda p: change_key_pose(p, puppet.id, number, places=places)
        )

    def clear_drag(self) -> None:
        """Clears the current drag."""
        self._dragged = None

    def nudge(self, offset: Float) -> bool:
        """Moves the selected control point by (3,) metres in the mesh's frame.

        With symmetry, its mirror point moves too.
        """
        puppet, point = self.puppet, self.point
        if puppet is None or point is None:
            return False
        self.drag(point, self._find_start_places(puppet)[point] + offset)
        return self.drop(later("nudge {0}", puppet.points[point].name))

    def reset_point(self) -> bool:
        """Moves the selected control point back to its rest position."""
        puppet, point = self.puppet, self.point
        if puppet is None or point is None:
            return False
        self.drag(point, puppet.rest[point])
        return self.drop(later("reset {0}", puppet.points[point].name))

    def remove_point(self) -> bool:
        """Removes the selected control point from the puppet and from all key poses, as one edit."""
        puppet, point = self.puppet, self.point
        if puppet is None or point is None:
            return False
        name, used = puppet.points[point].name, len(puppet.poses)
        if not self.editor.edit(later("remove {0}", name), lambda p: remove_point(p, puppet.id, name)):
            return False
        self.editor.select(handle=None)
        if used:
            self.editor.toasts.show_message(
                tr_n(
                    "{1} was removed, also from {0} key pose",
                    "{1} was removed, also from {0} key poses",
                    used,
                    name,
                ),
                tr("Press Ctrl+Z to undo this."),
            )
        return True

    def _find_start_places(self, puppet: ExampleCharacter) -> Float:
        """Returns the positions (P, 3) in metres at the start of a drag.

        They come from the key pose at this moment if there is one, otherwise from the shown pose.
        """
        if self.places is not None:
            return self.places
        moment = self._find_moment(puppet)
        pose_number = None if moment is None else self.pose_at(*moment)
        return self.current_places(puppet) if pose_number is None else puppet.poses[pose_number].places

    def current_places(self, puppet: ExampleCharacter) -> Float:
        """Returns the current positions (P, 3) of the puppet's control points in metres of the
        mesh's frame.
        """
        standing = self.stage.find(puppet.id)
        return puppet.rest if standing is None else standing.state.places

    def _begin_here(self, puppet: ExampleCharacter, places: Float) -> bool:
        """Stores the dragged positions as the key pose of the moment that the performer's view shows."""
        moment = self._find_moment(puppet)
        if moment is None:
            self.editor.toasts.show_message(
                tr("No take is shown, so this pose belongs to no moment"),
                tr("Choose a take in the performer's view, go to a moment of the take, and drag again."),
            )
            return False
        pose_number = self.pose_at(*moment)
        if pose_number is None:
            return self._add(puppet, *moment, places)
        self.edit_pose(pose_number)
        return self.editor.edit("pose", lambda p: change_key_pose(p, puppet.id, pose_number, places=places))

    def _find_moment(self, puppet: ExampleCharacter) -> tuple[str, float] | None:
        """Returns the shown take and the time in it, or None if no take is shown."""
        takes, moment = self.editor.project.takes, self.moment
        if moment is None and puppet.layers:
            layer = puppet.layers[0]
            moment = (layer.take, layer.find_played_time(self.editor.time, takes[layer.take].duration)[0])
        return moment if moment is not None and moment[0] in takes else None


def get_puppet_editor(editor: Editor) -> PuppetEditor:
    """Returns the puppet editor of an editor. The first call creates it, and registers it there."""
    puppets = editor.rig_editors.get(ExampleCharacter.kind)
    if not isinstance(puppets, PuppetEditor):
        puppets = editor.rig_editors[ExampleCharacter.kind] = PuppetEditor(editor)
    return puppets


def _clamp_place(puppet: ExampleCharacter, place: Float) -> Float:
    """Returns the place (3,), clamped to the maximum distance from the mesh's centre."""
    middle, max_distance = find_mesh_centre(puppet.mesh), _MAX_DRAG_DISTANCE * measure_mesh(puppet.mesh)
    offset = place - middle
    distance = float(np.linalg.norm(offset))
    return place if distance <= max_distance else middle + offset * (max_distance / distance)
