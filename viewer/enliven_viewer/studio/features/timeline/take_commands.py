"""Commands for alternative takes of a lane: play one, keep only one, or delete one."""

from __future__ import annotations

from collections.abc import Iterator

from enliven.modeling.edits import choose_take, drop_take, keep_take, list_alternative_takes
from enliven_viewer.language import later, tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.takes import delete_takes, list_unused_takes

_NO_ALTERNATIVES = later(
    "No lane with several takes is chosen. Record an alternative take (Ctrl+Shift+R), and choose its lane."
)


class TakeCommands:
    """Commands for the alternative takes of the selected lane, or of the only lane with several takes."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    @property
    def alternatives(self) -> str:
        """Returns the name of the group of alternative takes that the commands apply to.

        Returns an empty string without such a group.
        """
        project, chosen = self.editor.project, self.editor.selection
        character = project.characters.get(chosen.character or "")
        if character is not None and chosen.layer is not None and chosen.layer < len(character.playing):
            return character.playing[chosen.layer].alternatives
        groups = {
            layer.alternatives
            for candidate in ([character] if character is not None else project.characters.values())
            for layer in candidate.playing
            if len(list_alternative_takes(project, layer.alternatives)) > 1
        }
        return groups.pop() if len(groups) == 1 else ""

    @property
    def audible_take(self) -> str:
        """Returns the active take of the group :meth:`alternatives`, or an empty text if there is none."""
        takes = list_alternative_takes(self.editor.project, self.alternatives)
        return next((name for name, audible_take in takes.items() if audible_take), "")

    def describe_missing(self) -> str:
        """Returns the reason why no alternative take can be chosen, with advice, or an empty text if one can
        be chosen.
        """
        return (
            ""
            if len(list_alternative_takes(self.editor.project, self.alternatives)) > 1
            else _NO_ALTERNATIVES
        )

    def step(self, direction: int) -> None:
        """Switches to the next alternative take, or to the previous one if `direction` is -1."""
        names = list(list_alternative_takes(self.editor.project, self.alternatives))
        place = names.index(self.audible_take) if self.audible_take in names else -direction
        self.choose(names[(place + direction) % len(names)])

    def choose(self, recorded: str) -> None:
        """Makes one of the alternative takes active."""
        alternatives = self.alternatives
        if self.editor.edit(
            later("hear {0}", recorded), lambda project: choose_take(project, alternatives, recorded)
        ):
            self._select_take_lane(alternatives, recorded)

    def keep(self) -> None:
        """Keeps only the active take, and deletes its alternatives."""
        alternatives, audible_take = self.alternatives, self.audible_take
        if self.editor.edit(
            later("keep {0}", audible_take), lambda project: keep_take(project, alternatives, audible_take)
        ):
            self._select_take_lane(alternatives, audible_take)

    def drop(self, recorded: str = "") -> None:
        """Deletes one of the alternative takes, by default the active take."""
        alternatives, deleted_take = self.alternatives, recorded or self.audible_take
        if self.editor.edit(
            later("delete {0}", deleted_take), lambda project: drop_take(project, alternatives, deleted_take)
        ):
            self.editor.toasts.show_message(
                tr("{0} is deleted", deleted_take), tr("Press Ctrl+Z to undo this.")
            )
            self._select_take_lane(alternatives, self.audible_take)

    def _select_take_lane(self, alternatives: str, recorded: str) -> None:
        """Selects the lane of a take if a lane of its alternatives was selected."""
        editor = self.editor
        character = editor.project.characters.get(editor.selection.character or "")
        if character is None or editor.selection.layer is None:
            return
        layer_numbers = [
            number
            for number, layer in enumerate(character.playing)
            if layer.alternatives == alternatives and layer.recorded == recorded
        ]
        editor.select(layer=layer_numbers[0] if layer_numbers else None)


def make_take_actions(takes: TakeCommands) -> Iterator[Action]:
    """Yields the actions that switch between the alternative takes of a lane, and delete takes."""

    def describe_missing_unused() -> str:
        return (
            ""
            if list_unused_takes(takes.editor)
            else "All takes are in use. Remove the clips of a take first."
        )

    yield Action(
        "takes.next",
        "Clip",
        "Play the next take",
        ("alt+right",),
        lambda: takes.step(1),
        takes.describe_missing,
        about="Switches between the takes of this lane.",
        apart=True,
    )
    yield Action(
        "takes.before",
        "Clip",
        "Play the previous take",
        ("alt+left",),
        lambda: takes.step(-1),
        takes.describe_missing,
    )
    yield Action(
        "takes.keep",
        "Clip",
        "Keep only this take",
        (),
        takes.keep,
        takes.describe_missing,
        about="Deletes all other takes of this lane.",
    )
    yield Action(
        "takes.drop", "Clip", "Delete this take", ("alt+delete",), takes.drop, takes.describe_missing
    )
    yield Action(
        "takes.tidy",
        "Clip",
        "Delete unused takes",
        (),
        lambda: delete_takes(takes.editor, *list_unused_takes(takes.editor)),
        describe_missing_unused,
    )
