"""All characters of a project in their current poses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from enliven.arrays import Float
from enliven.document import Pose, Project, RigBase
from enliven.modeling.edits import get_rig_edits
from enliven_viewer.studio.editor.rig_editor import RigEditors
from enliven_viewer.studio.viewport.colours import DrawnMeshes
from enliven_viewer.studio.viewport.stage_character import StageCharacter


class ShownState(Protocol):
    """The state that a stage shows: a project and a time."""

    time: float

    @property
    def project(self) -> Project:
        """Returns the shown project."""


class StudioStage:
    """All characters of an editor's project. They are cached while nothing changes.

    Args:
        editor: the editor with the project and the time.
        rig_editors: place the characters with surfaces that are solved in the background.
    """

    def __init__(self, editor: ShownState, rig_editors: RigEditors) -> None:
        self._editor, self._rig_editors = editor, rig_editors
        self._meshes = DrawnMeshes()
        self._players: dict[str, tuple[tuple[object, ...], Callable[[float], tuple[Pose, Float]]]] = {}
        self._cache: tuple[Project, float, dict[str, StageCharacter]] | None = None

    @property
    def characters(self) -> tuple[StageCharacter, ...]:
        """Returns all characters, in the project's order."""
        return tuple(self.find(name) for name in self._editor.project.characters)

    def find(self, character_id: str) -> StageCharacter:
        """Returns one of the characters.

        Raises:
            InputError: if no character has the id.
        """
        project, time = self._editor.project, self._editor.time
        character = project.character(character_id)
        placed = self._rig_editors[character.kind].stage_character(character)
        if placed is not None:
            return placed
        if self._cache is None or self._cache[0] is not project or self._cache[1] != time:
            self._cache = (project, time, {})
            self._players = {
                name: player for name, player in self._players.items() if name in project.characters
            }
        characters = self._cache[2]
        if character_id not in characters:
            characters[character_id] = self._place_character(project, character, time)
        return characters[character_id]

    def _place_character(self, project: Project, character: RigBase, time: float) -> StageCharacter:
        cached, played = self._players.get(character.id), character.needed().items()
        # Compare the takes too. Editing a key replaces a take under the same name, but does not change the
        # character.
        takes = (getattr(project, held)[name] for held, names in played for name in sorted(names))
        needs = (character, *takes)
        if cached is None or [*map(id, cached[0])] != [*map(id, needs)]:
            cached = self._players[character.id] = (
                needs,
                get_rig_edits(character).create_player(project, character),
            )
        return StageCharacter(character, self._meshes.get_mesh(character), *cached[1](time))
