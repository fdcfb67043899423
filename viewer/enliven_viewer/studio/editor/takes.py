"""Lists the takes of the project that no layer plays, and deletes takes."""

from __future__ import annotations

from enliven.document import Project
from enliven.modeling.edits import delete_take, drop_take, list_alternative_takes
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor


def delete_take_row(editor: Editor, name: str) -> None:
    """Deletes the take of a row: an alternative take of a lane, or a take that no layer plays."""
    project = editor.project
    played_layers = [layer for character in project.characters.values() for layer in character.playing]
    layers_of_take = [layer for layer in played_layers if (layer.source, layer.take) == ("takes", name)]
    recorded = {(layer.alternatives, layer.recorded) for layer in layers_of_take}
    alternatives, take_name = recorded.pop() if len(recorded) == 1 else ("", "")
    if len(list_alternative_takes(project, alternatives)) < 2:
        delete_takes(editor, name)
    elif editor.edit(
        later("delete {0}", take_name), lambda project: drop_take(project, alternatives, take_name)
    ):
        editor.toasts.show_message(tr("{0} is deleted", take_name), tr("Press Ctrl+Z to undo this."))


def list_unused_takes(editor: Editor) -> list[str]:
    """Returns the takes that no layer plays."""
    project = editor.project
    used = set[str]().union(
        *(character.find_needed_ids()["takes"] for character in project.characters.values())
    )
    return [name for name in project.takes if name not in used]


def delete_takes(editor: Editor, *names: str) -> None:
    """Deletes takes that no layer plays."""

    def change(project: Project) -> Project:
        for name in names:
            project = delete_take(project, name)
        return project

    subject = names[0] if len(names) == 1 else later("{0} takes", len(names))
    if editor.edit(later("delete {0}", subject), change):
        editor.toasts.show_message(tr("Deleted {0}", subject), tr("Press Ctrl+Z to undo this."))
