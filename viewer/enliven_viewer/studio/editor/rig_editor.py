"""The interface through which features add the editing of a type of rig to the editor."""

from __future__ import annotations

from enliven.document import Project, RigBase
from enliven_viewer.studio.viewport.stage_character import StageCharacter


class RigEditor:
    """Shows and edits the characters with one type of rig. This base class is for rigs without a feature.

    A feature registers its object in :attr:`Editor.rig_editors`.
    """

    def stage_character(self, character: RigBase) -> StageCharacter | None:
        """Returns a character of the project in its current pose. None if the editor must place it."""
        return None

    def find_shown(self, project: Project, character_id: str) -> tuple[Project, RigBase]:
        """Returns a character that can be shown now, and the project with its motions. They may be older than
        the project while the newest motion is being solved.
        """
        return project, project.character(character_id)

    def settle_motion(self, project: Project, character_id: str) -> None:
        """Waits until the motion of a character is solved."""

    def settle_surfaces(self) -> None:
        """Solves surfaces again that were only solved coarsely while the playhead was dragged."""

    def accept(self) -> None:
        """Ends unfinished editing, and keeps the result."""

    def advance(self) -> None:
        """Advances one frame."""


class RigEditors(dict[str, RigEditor]):
    """The rig editors by the kind of rig."""

    def __missing__(self, kind: str) -> RigEditor:
        return RigEditor()
