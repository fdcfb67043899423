"""Starting, editing, accepting and cancelling key poses."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import ExampleCharacter, KeyPose, Project
from enliven.examples.puppet_motion import PuppetState
from enliven.modeling.puppet.dragging import key_pose_at
from enliven.modeling.puppet.poses import add_key_pose, change_key_pose, remove_key_pose
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.puppet_selection import PuppetSelection
from enliven_viewer.studio.puppets.puppet_stage import PuppetStage, StagePuppet
from enliven_viewer.studio.puppets.puppet_states import find_start_places


class KeyPoses(PuppetSelection):
    """The key pose of the selected puppet that is being edited.

    Attributes:
        start_state: state of the puppet when editing began. The puppet stays at this position while the key
            pose is edited.
    """

    def __init__(self, editor: Editor, stage: PuppetStage) -> None:
        super().__init__(editor, stage)
        self.start_state: PuppetState | None = None
        self._edited_pose: tuple[str, int] | None = None
        self._states_before: dict[int, Float] | None = None
        self._edited_time = 0.0

    def leave_elsewhere(self) -> None:
        """Stops editing the key pose if the project plays, or the time or the selected puppet has changed."""
        elsewhere = self.editor.playing or abs(self.editor.time - self._edited_time) > 1e-9
        if self._edited_pose is not None and (
            elsewhere or self.editor.selection.character != self._edited_pose[0]
        ):
            self.accept()

    @property
    def number(self) -> int | None:
        """Returns the number of the edited key pose, or None while the puppet plays."""
        puppet = self.puppet
        if self._edited_pose is None or puppet is None or self._edited_pose[0] != puppet.id:
            return None
        return self._edited_pose[1] if self._edited_pose[1] < len(puppet.poses) else None

    @property
    def is_posing(self) -> bool:
        """Returns True if a key pose is being edited."""
        return self.number is not None

    @property
    def key(self) -> KeyPose | None:
        """Returns the edited key pose."""
        puppet, number = self.puppet, self.number
        return puppet.poses[number] if puppet is not None and number is not None else None

    @property
    def previous(self) -> KeyPose | None:
        """Returns the key pose before the edited key pose, for comparison. For the first key pose, returns
        the next.
        """
        puppet, number = self.puppet, self.number
        if puppet is None or number is None or len(puppet.poses) < 2:
            return None
        return puppet.poses[number - 1 if number else 1]

    def begin_pose(self, take: str, time: float) -> bool:
        """Adds a key pose at a time of a take, in the puppet's current pose. If there is already a key pose
        at this time, edits it instead.
        """
        puppet = self._selected_puppet()
        if puppet is None:
            return False
        pose_number = self.pose_at(take, time)
        if pose_number is not None:
            return self.edit_pose(pose_number)
        return self._add(puppet, take, time, find_start_places(self.editor.project, puppet, take, time))

    def pose_at(self, take: str, time: float) -> int | None:
        """Returns the number of the selected puppet's key pose at a time of a take, or None."""
        puppet, project = self.puppet, self.editor.project
        return key_pose_at(project, puppet, take, time) if puppet and take in project.takes else None

    def edit_pose(self, number: int) -> bool:
        """Edits an existing key pose."""
        puppet = self._selected_puppet()
        if puppet is None or not 0 <= number < len(puppet.poses):
            return False
        old_places = dict(zip((p.vertex for p in puppet.points), puppet.poses[number].places, strict=True))
        self._edit(puppet.id, number, old_places, self.stage.find(puppet.id))
        return True

    def accept(self) -> None:
        """Keeps the key pose and stops editing it. The puppet plays again."""
        self._edited_pose = self._states_before = self.start_state = None
        self.clear_drag()

    def clear_drag(self) -> None:
        """Clears the current drag."""

    def cancel(self) -> None:
        """Restores the key pose to its state before editing, or removes it if it is new."""
        puppet, number, old_states = self.puppet, self.number, self._states_before
        self.accept()
        if puppet is None or number is None:
            return
        if old_states is None:
            self.editor.edit("drop the key pose", lambda p: remove_key_pose(p, puppet.id, number))
            return
        now = puppet.poses[number].places
        places = np.array([old_states.get(point.vertex, now[k]) for k, point in enumerate(puppet.points)])
        if not np.array_equal(places, now):
            self.editor.edit(
                "drop the changes", lambda p: change_key_pose(p, puppet.id, number, places=places)
            )

    def _edit(
        self, puppet: str, number: int, before: dict[int, Float] | None, standing: StagePuppet | None
    ) -> None:
        """Starts editing a key pose.

        ``before`` maps each vertex to its previous position; None for a new key pose.
        """
        self.start_state = (
            standing.state if standing is not None and self.start_state is None else self.start_state
        )
        self._edited_pose, self._states_before = (puppet, number), before
        self.clear_drag()
        self.editor.playing, self._edited_time = False, self.editor.time

    def _add(self, puppet: ExampleCharacter, take: str, time: float, places: Float) -> bool:
        """Adds a key pose as one edit, and starts editing it."""
        if not puppet.points:
            self.editor.toasts.show_message(
                tr("The puppet has no control points yet"), tr("Click the mesh where you want to drag it.")
            )
            return False
        standing = self.stage.find(puppet.id)

        def adding(project: Project) -> Project:
            return add_key_pose(project, puppet.id, take, time, places)

        if not self.editor.edit(later("add key pose {0}", len(puppet.poses) + 1), adding):
            return False
        self._edit(puppet.id, len(puppet.poses), None, standing)
        return True
