"""The state behind the studio's window: editor, input, project store, dialogues and the rectangles of
widgets.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from enliven.document import ExampleCharacter, Project
from enliven.errors import EnlivenError
from enliven_viewer.language import tr
from enliven_viewer.studio.actions.palette_search import PaletteSearch
from enliven_viewer.studio.actions.shortcut_capture import ShortcutCapture
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.file_browser import FileBrowser
from enliven_viewer.studio.editor.background import WorkProgress
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.registry import register_features
from enliven_viewer.studio.workspace.action_table import make_studio_actions
from enliven_viewer.studio.workspace.commands import Commands
from enliven_viewer.studio.workspace.depth_tracking import DepthTracking, lacks_tracking
from enliven_viewer.studio.workspace.exporting import ExportOptions, write_export
from enliven_viewer.studio.workspace.files import (
    EXPORT_SUFFIXES,
    FILE_TYPES,
    FILM_SUFFIX,
    SESSION_SUFFIXES,
    add_file,
    add_sample,
    list_exportable,
    list_suffixes,
    read_addable_file,
    read_library,
    save_session,
)
from enliven_viewer.studio.workspace.project_comparison import (
    Difference,
    compare_projects,
    with_saved_items,
)
from enliven_viewer.studio.workspace.project_store import PROJECT_SUFFIX, FileChangedError, ProjectStore

_BACKGROUND_READ_BYTES = 6_000_000
"""Larger files than this, in bytes, are read in the background. Smaller files open within half a second."""


class Workspace(App):
    """The complete state of the window, which panels draw and change. It also works without a window.

    Attributes:
        commands: the functions behind the studio's own actions.
        depth: the tracker for opened depth recordings.
        exporting: the options of the next export or film.
        finding: the search of the command palette. wanted_key: the shortcut change in the preferences.
        history_shown: True if the history list is open. history_seen: its length and step when it was last
            drawn.
        caption: the caption of a scripted session; empty without one.
        pressed: the key that a scripted session is pressing.
        compared: the differences between the project and its file, once they were requested.
        ended: True if the studio must close.
    """

    def __init__(self, editor: Editor, folder: Path | None = None) -> None:
        super().__init__(editor, folder)
        if self.preferences.refusal is not None:
            editor.toasts.show_error(self.preferences.refusal)
        editor.less_motion = lambda: self.preferences.less_motion
        self.commands = Commands(editor)
        self.file_types += FILE_TYPES
        self.actions.add(*make_studio_actions(self.commands, self.input, self, self.preferences))
        self.input.key_filter = lambda key: (
            self.actions.press(key, workspace_only=True) or any(handle(key) for handle in self.key_handlers)
        )
        self.store, self.depth = ProjectStore(editor, folder), DepthTracking(editor)
        self.transport_sections.append(self._draw_tracking)
        self.caption = self.pressed = ""
        self.exporting = ExportOptions()
        self.finding, self.wanted_key = PaletteSearch(self.actions), ShortcutCapture()
        self.history_shown, self.history_seen = False, (0, 0)
        self.ended = False
        self.compared: tuple[Difference, ...] | None = None
        self._waiting_command: Callable[[], object] | None = None
        register_features(self)
        self.store.recording = self.recording

    @classmethod
    def new(cls, editor: Editor, folder: Path | None = None) -> Workspace:
        """Returns a workspace with a project that contains only the library of motions."""
        workspace = cls(editor, folder)
        workspace.store.new(Project().with_takes(*read_library()))
        return workspace

    def open_dialogue(self, name: str) -> None:
        """Opens a dialogue, such as "open", "export" or "preferences"."""
        if name in self._list_file_endings():
            self._browse(name)
        else:
            self.finding, self.wanted_key = PaletteSearch(self.actions), ShortcutCapture()
            self.asking = name

    def start_project(self) -> None:
        """Starts a new project with the library of motions. Asks first if unsaved work would be lost."""
        if not self._asks_about_unsaved(self.start_project):
            self.store.new(Project().with_takes(*read_library()))

    def quit(self) -> None:
        """Closes the studio. Asks first if unsaved work would be lost."""
        if not self._asks_about_unsaved(self.quit):
            self.ended = True

    def toggle_start_page(self) -> None:
        """Shows or hides the start page."""
        self.starting = not self.starting

    def toggle_history(self) -> None:
        """Shows or hides the list of edits."""
        self.history_shown = not self.history_shown

    def add_sample(self, name: str) -> None:
        """Adds a sample.

        A mesh for possession is also put onto the stage, now or once a stage is connected.
        """
        add_sample(self.editor, name)
        character = self.editor.find_selected()
        if character is not None and character.is_possessable:
            self.live.put(character.id)

    def open_recent(self) -> None:
        """Opens the last file again."""
        self.open(Path(self.preferences.recent[0]))

    def open(self, path: Path) -> None:
        """Adds a model or take, or opens a project. Asks first if unsaved work would be lost.

        Raises:
            InputError: if the file cannot be read.
        """
        if path.suffix.lower() == PROJECT_SUFFIX and self._asks_about_unsaved(
            lambda: self.run_and_report(lambda: self.open(path))
        ):
            return
        if _is_large(path) and not lacks_tracking(path):
            self._open_next_to_current(path)
            return
        if lacks_tracking(path):
            self.depth.begin(path)
        elif path.suffix.lower() != PROJECT_SUFFIX:
            old_count = len(self.editor.project.characters)
            add_file(self.editor, path, self.file_types)
            if len(self.editor.project.characters) > old_count:
                self.commands.fitting.show_size_hint()
        else:
            self.store.open(path)
        self.preferences.remember_file(path)

    def _open_next_to_current(self, path: Path) -> None:
        """Reads a large file in the background. The window stays usable, and reading can be cancelled."""
        progress = WorkProgress()

        def add(read: Any) -> None:
            if path.suffix.lower() == PROJECT_SUFFIX:
                self.run_and_report(lambda: self.store.take(path, read))
            else:
                old_count = len(self.editor.project.characters)
                self.run_and_report(lambda: read[0](self.editor, path, read[1]))
                if len(self.editor.project.characters) > old_count:
                    self.commands.fitting.show_size_hint()
            self.preferences.remember_file(path)

        def work() -> Any:
            return (
                self.store.read(path)
                if path.suffix.lower() == PROJECT_SUFFIX
                else read_addable_file(path, self.file_types)
            )

        self.editor.background.begin(tr("Opening {0}", path.name), work, add, progress)

    def drop(self, paths: list[Path]) -> None:
        """Opens files that were dropped onto the window. Stops at a file that opens a dialogue."""
        for path in paths:
            if not self.asking:
                self.run_and_report(lambda path=path: self.open(path))

    def finish_file_dialog(self, path: Path) -> None:
        """Handles the file that was chosen in the dialogue.

        Raises:
            EnlivenError: if the file cannot be read or written.
        """
        dialogue, self.asking = self.asking, ""
        if dialogue == "open":
            self.open(path)
        elif dialogue in ("export", "film"):
            self._export(path)
        elif dialogue in self.file_dialogs:
            self.file_dialogs[dialogue].open(path)
        elif dialogue == "session":
            save_session(self.editor.project, self.editor.selection.character or "", path)
            self.editor.toasts.show_message(
                tr("Saved {0}", path.name),
                tr("Run `enliven examples fit` to compute its motion without a window."),
            )
        else:
            self.save(path)

    def continue_waiting_command(self, *, discard: bool) -> None:
        """Saves or discards unsaved work, then continues the command that waited for this decision."""
        self.asking = ""
        if discard:
            self.store.forget()
            self._run_waiting_command()
            return
        # Stop the recording first, so that it becomes part of the saved project.
        self.recording.stop()
        self.save_or_ask()

    def save(self, path: Path | None = None, *, over: bool = False) -> None:
        """Saves the project, then continues the command that waited for it.

        Asks if another window has saved the file.

        Args:
            path: the project's new file. None keeps the current one.
            over: if True, overwrite the file even if another window has saved it since.

        Raises:
            EnlivenError: if the file cannot be written. The waiting command is dropped.
        """
        self.asking = ""
        try:
            self.store.save(path, over=over)
        except FileChangedError:
            self.asking, self.compared = "changed", None
        except EnlivenError:
            self.cancel()
            raise
        else:
            if path is not None:
                self.preferences.remember_file(path)
            self._run_waiting_command()

    def save_or_ask(self) -> None:
        """Saves the project. Asks for a name if it has none."""
        if self.store.path is None:
            self.ask_for_name()
        else:
            self.run_and_report(self.save)

    def ask_for_name(self) -> None:
        """Opens the dialogue that saves the project under another name.

        A waiting command continues afterwards.
        """
        self._browse("save as")

    def compare(self) -> None:
        """Compares the project with the version that another window saved to its file."""
        self.run_and_report(lambda: setattr(self, "compared", self._find_differences()))

    def add_saved_items(self) -> None:
        """Adds the items that only the file contains to the project, as one edit. Updates the comparison."""

        def add() -> None:
            saved = self.store.read_saved()
            self.editor.edit("add the contents of the file", lambda project: with_saved_items(project, saved))

        if self.run_and_report(add):
            self.compare()

    def _find_differences(self) -> tuple[Difference, ...]:
        return compare_projects(self.editor.history.project, self.store.read_saved())

    @property
    def is_saved(self) -> bool:
        """Returns True if the project has a file without unsaved changes."""
        return self.store.named and not self.store.dirty

    def cancel(self) -> None:
        """Closes the dialogue and drops the waiting command."""
        self.asking, self._waiting_command = "", None

    def _draw_tracking(self) -> None:
        # Imported late, so that a workspace without a window works without ImGui.
        from enliven_viewer.studio.workspace.tracking_progress import draw_tracking_progress

        draw_tracking_progress(self, self.depth)

    @property
    def export_suffix(self) -> str:
        """Returns the suffix of the file name in the export dialogue, or the default suffix if the name has
        none.
        """
        typed = Path(self.browser.name).suffix.lower() if self.browser is not None else ""
        return typed or EXPORT_SUFFIXES[0]

    def _export(self, path: Path) -> None:
        """Writes the file in the background, because it may take long to solve surfaces."""
        project, toasts = self.editor.project, self.editor.toasts
        characters, options = list_exportable(project), replace(self.exporting)
        length, progress = self.editor.length, WorkProgress()
        options.filter_characters(characters)
        options.check_range(length)

        def tell(message: str) -> None:
            first, _, rest = message.partition(". ")
            toasts.show_message(first, rest)

        def work() -> str:
            return write_export(project, path, characters, options, length, progress)

        self.editor.background.begin(tr("Writing {0}", path.name), work, tell, progress)

    def _list_file_endings(self) -> dict[str, tuple[str, ...]]:
        """Returns the suffixes of the files that each file dialogue shows, by the dialogue's name."""
        return {
            "open": (PROJECT_SUFFIX, *list_suffixes(self.file_types)),
            "save as": (PROJECT_SUFFIX,),
            "export": EXPORT_SUFFIXES,
            "film": (FILM_SUFFIX,),
            "session": SESSION_SUFFIXES,
            **{name: opened.suffixes for name, opened in self.file_dialogs.items()},
        }

    def _browse(self, dialogue: str) -> None:
        folder = self.store.path.parent if self.store.path else Path.cwd()
        endings = self._list_file_endings()[dialogue]
        puppet, unnamed = self.editor.find_selected(ExampleCharacter), self.store.path is None
        about_it = dialogue == "session" or (dialogue in ("export", "film") and unnamed)
        stem = puppet.id if puppet is not None and about_it else self.store.name
        opens = dialogue == "open" or dialogue in self.file_dialogs
        name = "" if opens else f"{stem}{endings[0]}"
        project_path = self.store.path if dialogue == "save as" else None
        self.browser = FileBrowser(folder, endings, name, not opens, project_path)
        self.asking = dialogue

    def _asks_about_unsaved(self, command: Callable[[], object]) -> bool:
        """Opens the dialogue about unsaved work, if there is any. ``command`` then waits for the decision."""
        if self.store.dirty:
            self._waiting_command, self.asking = command, "unsaved"
        return self.store.dirty

    def _run_waiting_command(self) -> None:
        """Runs the command that waited for the decision about unsaved work."""
        command, self._waiting_command = self._waiting_command, None
        if command is not None:
            command()


def _is_large(path: Path) -> bool:
    """Returns True if a file is too large to be read without blocking the window."""
    try:
        return path.stat().st_size > _BACKGROUND_READ_BYTES
    except OSError:
        return False
