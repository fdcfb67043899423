"""The commands of the outliner: filter, fold, select, rename, hide, lock and reorder."""

from __future__ import annotations

from collections.abc import Callable

from enliven.document import FREE, DisplayState, Project
from enliven.modeling.edits import handle_characters, order_characters, rename_character, rename_take
from enliven_viewer.language import language_in_use, later
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.outliner.tree import CHARACTER, GROUP, HANDLE, TAKE, Row, make_rows


class Outliner:
    """The tree of all objects, with its view state.

    Visibility, locks, names and order belong to the project and can be undone. Folding and the
    filter text belong to the window.

    Args:
        editor: the editor with the project.
        live: a function that returns one line per object on the stage of an edge.

    Attributes:
        typed: filter text for names; empty shows all.
        opened: keys of the unfolded rows.
        renaming: key of the row being renamed, or empty. draft: the name typed so far.
        followed: the character that the list was last scrolled to.
    """

    def __init__(self, editor: Editor, live: Callable[[], tuple[str, ...]] = lambda: ()) -> None:
        self.editor, self._get_live = editor, live
        self.typed = self.renaming = self.draft = ""
        self.opened = {f"{GROUP} {name}" for name in ("shapes", "takes", "live")}
        self.followed: str | None = None
        self._range_start = ""
        self._cached_rows: tuple[tuple[object, ...], tuple[Row, ...]] | None = None

    @property
    def rows(self) -> tuple[Row, ...]:
        """Returns the visible rows."""
        project, live = self.editor.project, self._get_live()
        key = (project, live, frozenset(self.opened), self.typed, language_in_use())
        if (
            self._cached_rows is None
            or self._cached_rows[0][0] is not project
            or self._cached_rows[0][1:] != key[1:]
        ):
            self._cached_rows = (key, make_rows(project, live, self.opened, self.typed))
        return self._cached_rows[1]

    def toggle_folded(self, row: Row) -> None:
        """Folds or unfolds a row."""
        self.opened ^= {row.key}

    def is_chosen(self, row: Row) -> bool:
        """Returns True if the object of a row is selected."""
        chosen = self.editor.selection
        if row.kind == HANDLE:
            return chosen.character == row.id and (row.number == chosen.handle or row.number in chosen.chain)
        return row.kind == CHARACTER and row.id in chosen.characters

    def click(self, row: Row, *, shift: bool = False, ctrl: bool = False) -> None:
        """Selects the object of a row. Ctrl adds or removes it, Shift selects the range up to it."""
        editor = self.editor
        if row.kind == HANDLE:
            handled = row.number < len(editor.project.characters[row.id].handles)
            editor.select_only(row.id, row.number if handled else None)
        elif row.kind == CHARACTER and shift:
            self._select_range(row.id)
            return
        elif row.kind == CHARACTER and ctrl:
            editor.toggle_selected(row.id)
        elif row.kind == CHARACTER:
            editor.select_only(row.id)
        self._range_start = row.id

    def _select_range(self, name: str) -> None:
        """Selects all characters between the previously clicked one and this one."""
        names = [row.id for row in self.rows if row.kind == CHARACTER]
        start = self._range_start if self._range_start in names else (self.editor.selection.character or name)
        first, last = (names.index(end) if end in names else names.index(name) for end in (start, name))
        low, high = min(first, last), max(first, last)
        between = [other for other in names[low : high + 1] if other != name]
        self.editor.choose_all(*between, name)

    # Names ------------------------------------------------------------------------------------------------

    def begin_rename(self, row: Row | None = None) -> None:
        """Starts renaming a row, or the selected character if no row is given."""
        if row is None:
            # Clear the filter, so that the row becomes visible, and scroll to it.
            self.typed, self.followed = "", None
            self.opened.add(f"{GROUP} shapes")
        row = row or next(
            (
                candidate
                for candidate in self.rows
                if candidate.kind == CHARACTER and self.is_leading(candidate)
            ),
            None,
        )
        if row is not None and row.kind in (CHARACTER, TAKE):
            self.renaming, self.draft = row.key, row.id

    def is_leading(self, row: Row) -> bool:
        """Returns True if the row's object is the active character, which was selected last."""
        return row.id == self.editor.selection.character

    def end_rename(self, row: Row, *, keep: bool) -> None:
        """Applies the typed name, or keeps the old one."""
        new_name, self.renaming = self.draft.strip(), ""
        if not keep or not new_name or new_name == row.id:
            return
        editor, old_selection = self.editor, self.editor.selection
        if row.kind == TAKE:
            editor.edit("rename", lambda project: rename_take(project, row.id, new_name))
        elif editor.edit("rename", lambda project: rename_character(project, row.id, new_name)):
            named = tuple(
                new_name if character == row.id else character for character in old_selection.characters
            )
            editor.choose_all(*named)
            if old_selection.character == row.id:
                editor.select(
                    handle=old_selection.handle, layer=old_selection.layer, chain=old_selection.chain
                )
            if row.key in self.opened:
                self.opened.add(f"{CHARACTER} {new_name}")

    # Visibility, locks and order --------------------------------------------------------------------------

    def find_handling(self, name: str) -> DisplayState:
        """Returns the visibility and lock state of a character."""
        return self.editor.project.handling.get(name, FREE)

    def set_hidden(self, *names: str, is_hidden: bool) -> None:
        """Hides or shows characters, as one edit."""
        self._set_display_state(names, "hide" if is_hidden else "show", hidden=is_hidden)

    def set_locked(self, *names: str, is_locked: bool) -> None:
        """Locks or unlocks characters, as one edit."""
        self._set_display_state(names, "lock" if is_locked else "unlock", locked=is_locked)

    def hide_others(self) -> None:
        """Hides every character that is not selected, as one edit."""
        chosen = self.editor.selection.characters

        def change(project: Project) -> Project:
            rest = [name for name in project.characters if name not in chosen]
            return handle_characters(handle_characters(project, rest, hidden=True), chosen, hidden=False)

        self.editor.edit("hide the others", change)

    def _set_display_state(self, names: tuple[str, ...], edit_name: str, **changes: bool) -> None:
        subject = names[0] if len(names) == 1 else later("{0} shapes", len(names))
        self.editor.edit(
            f"{edit_name} {subject}", lambda project: handle_characters(project, names, **changes)
        )

    def move(self, name: str, place: int) -> None:
        """Moves a character to another position in the list, as one edit."""
        if 0 <= place < len(self.editor.project.characters):
            self.editor.edit(
                later("reorder {0}", name), lambda project: order_characters(project, name, place)
            )

    def find_place(self, name: str) -> int:
        """Returns the position of a character in the list."""
        return list(self.editor.project.characters).index(name)
