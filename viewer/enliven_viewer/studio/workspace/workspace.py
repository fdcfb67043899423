"""The state behind the studio's window: editor, input, project store, dialogues and the places of widgets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from enliven.document import Project, Puppet
from enliven.errors import EnlivenError, InputError
from enliven_viewer.language import tr
from enliven_viewer.studio.actions import ActionTable, Finding, WantedKey
from enliven_viewer.studio.background import WorkProgress
from enliven_viewer.studio.curves import CurveInput
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.examples import layer_of
from enliven_viewer.studio.ghosts import Ghosts
from enliven_viewer.studio.motions import library
from enliven_viewer.studio.numbers import Figures
from enliven_viewer.studio.outliner import Outliner, outliner_actions
from enliven_viewer.studio.perform import PerformSession, perform_actions
from enliven_viewer.studio.performer import PerformerView
from enliven_viewer.studio.preferences import Preferences
from enliven_viewer.studio.scan import ScanSession, scan_actions
from enliven_viewer.studio.sound import SOUNDS, SoundPlayer, sound_actions
from enliven_viewer.studio.start import DrawnWidgets, Tour
from enliven_viewer.studio.timeline import TimelineInput
from enliven_viewer.studio.workspace.action_table import studio_actions
from enliven_viewer.studio.workspace.commands import Commands
from enliven_viewer.studio.workspace.depth_tracking import DepthTracking, lacks_tracking
from enliven_viewer.studio.workspace.exporting import ExportOptions, write_export
from enliven_viewer.studio.workspace.file_browser import FileBrowser
from enliven_viewer.studio.workspace.files import (
    EXPORTS,
    FILM,
    MESHES,
    MODELS,
    PERFORMANCES,
    SESSIONS,
    TAKES,
    add_file,
    add_sample,
    exportable,
    read_to_add,
    save_session,
)
from enliven_viewer.studio.workspace.input import ViewportInput
from enliven_viewer.studio.workspace.project_comparison import (
    Difference,
    compare_projects,
    with_saved_items,
)
from enliven_viewer.studio.workspace.project_store import PROJECT, FileChangedError, ProjectStore
from enliven_viewer.studio.workspace.view_table import curve_action, ghost_action

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom in the window's pixels."""
_LARGE_BYTES = 6_000_000
"""Bytes of a file that is read in the background: smaller ones open within half a second."""
_ROOM = 1.35
"""How much air is left around a puppet that is brought into the picture."""


class Workspace:
    """Everything that panels draw and change; it works without a window as well.

    Attributes:
        preferences: what the artist chose once and for all.
        actions: everything that can be done, for menus, keys, buttons and the palette.
        commands: what the studio's own actions do.
        ghosts: where characters were and will be; curves: the selection, over time.
        outliner: the tree of all things.
        figures: where the selection stands and how large it is; typing: what is typed into its fields.
        depth: the tracker of depth that was opened.
        sound: plays what is performed along.
        widgets: where each widget was drawn last, by name, so that a session can click on it.
        drawn: the same, with the picture in which each was drawn, for the tour.
        asking: the dialogue that is open, or empty.
        browser: what a dialogue about files shows.
        exporting: what the next export or film holds.
        finding: what the palette finds; wanted_key: the key that the preferences change.
        history_shown: whether the list of steps is open; history_seen: its length and step when it was drawn.
        shown_layer: the character and the layer that the panel at the right showed last.
        starting: whether the start page is shown while nothing is there; tour: the tour while it is taken.
        caption: what a session says of what it does; empty without a session.
        pressed: the key that a session presses just now.
        compared: what the project and its file do not share, once it was asked for.
        ended: whether the studio is to end.
    """

    def __init__(self, editor: Editor, folder: Path | None = None) -> None:
        self.editor = editor
        self.preferences = Preferences(folder)
        if self.preferences.refusal is not None:
            editor.toasts.complain(self.preferences.refusal)
        self.actions = ActionTable(editor.toasts, self.preferences)
        editor.less_motion = lambda: self.preferences.less_motion
        self.commands = Commands(editor)
        self.input = ViewportInput(editor, self.actions)
        self.ghosts = Ghosts(editor)
        self.actions.add(*studio_actions(self.commands, self.input, self.ask, self.preferences))
        self.timeline = TimelineInput(editor)
        self.curves = CurveInput(editor, self.timeline)
        self.sound = SoundPlayer(editor)
        self.actions.add(*sound_actions(self.sound))
        self.actions.add(ghost_action(self.ghosts), curve_action(self.curves))
        self.perform = PerformSession(editor, folder)
        self.actions.add(*perform_actions(self.perform))
        self.actions.room = lambda: self.perform.keys_of
        self.scan = ScanSession(editor, self.perform)
        self.input.over = self.scan
        self.actions.add(*scan_actions(self.scan))
        self.figures, self.typing = Figures(editor), dict[str, str]()
        self.outliner = Outliner(editor, lambda: self.perform.present)
        self.actions.add(*outliner_actions(self.outliner))
        self.timeline.rows.edit_pose, self.timeline.rows.begin_pose = self.edit_pose, self.begin_pose
        self.input.first = lambda key: (
            self.actions.press(key, own=True) or self.curves.type(key) or self.timeline.rows.type(key)
        )
        self.puppets = editor.puppets
        self.performer, self.coverages = PerformerView(editor), self.timeline.rows.coverages
        self.store, self.depth = ProjectStore(editor, folder), DepthTracking(editor)
        self.store.recording = self.perform.recording
        self.widgets: dict[str, Rectangle] = {}
        self.drawn = DrawnWidgets()
        self.asking = self.caption = self.pressed = ""
        self.browser: FileBrowser | None = None
        self.exporting = ExportOptions()
        self.finding, self.wanted_key = Finding(self.actions), WantedKey()
        self.history_shown, self.history_seen = False, (0, 0)
        self.shown_layer: tuple[str, int] | None = None
        self.ended = self.starting = False
        self.compared: tuple[Difference, ...] | None = None
        self.tour: Tour | None = None
        self._after = ""
        self._wanted: Path | None = None

    @classmethod
    def new(cls, editor: Editor, folder: Path | None = None) -> Workspace:
        """Returns a workspace with an empty project and the library of motions."""
        workspace = cls(editor, folder)
        workspace.store.new(Project().with_takes(*library()))
        return workspace

    def ask(self, dialogue: str) -> None:
        """Opens a dialogue, or does at once what needs none."""
        if dialogue in ("new", "quit") and self.store.dirty:
            self._after, self.asking = dialogue, "unsaved"
        elif dialogue == "new":
            self.store.new(Project().with_takes(*library()))
        elif dialogue == "quit":
            self.ended = True
        elif dialogue == "tour":
            self._begin_tour()
        elif dialogue == "start":
            self.starting = not self.starting
        elif dialogue.startswith("sample "):
            self._add_sample(dialogue.removeprefix("sample "))
        elif dialogue == "again":
            self.open(Path(self.preferences.recent[0]))
        elif dialogue == "history":
            self.history_shown = not self.history_shown
        elif dialogue == "save" and self.store.path is not None:
            self.attempt(self.save)
        elif dialogue in ("open", "save", "save as", "export", "film", "session", "perform"):
            self._browse("save as" if dialogue == "save" else dialogue)
        else:
            self.finding, self.wanted_key = Finding(self.actions), WantedKey()
            self.asking = dialogue

    def _add_sample(self, name: str) -> None:
        """Adds a sample; a mesh to step into goes onto the stage, or onto the next one that is connected."""
        add_sample(self.editor, name)
        one = self.editor.chosen()
        if one is not None and one.kind == "graph":
            self.perform.room = "Perform"
            self.perform.put_soon(one.id)

    def open(self, path: Path) -> None:
        """Adds a model or take, or opens a project; asks first where work would be lost.

        Raises:
            InputError: if the file cannot be read.
        """
        if path.suffix.lower() == PROJECT and self.store.dirty:
            self._after, self._wanted, self.asking = "open", path, "unsaved"
            return
        if _is_large(path) and not lacks_tracking(path):
            self._open_beside(path)
            return
        if lacks_tracking(path):
            self.depth.begin(path)
        elif path.suffix.lower() != PROJECT:
            before = len(self.editor.project.characters)
            add_file(self.editor, path)
            if len(self.editor.project.characters) > before:
                self.commands.fitting.tell()
        else:
            self.store.open(path)
        self.preferences.opened(path)

    def _open_beside(self, path: Path) -> None:
        """Reads a large file in the background: the window goes on, and it can be cancelled."""
        progress = WorkProgress()

        def add(read: Any) -> None:
            if path.suffix.lower() == PROJECT:
                self.attempt(lambda: self.store.take(path, read))
            else:
                before = len(self.editor.project.characters)
                self.attempt(lambda: read[0](self.editor, path, read[1]))
                if len(self.editor.project.characters) > before:
                    self.commands.fitting.tell()
            self.preferences.opened(path)

        def work() -> Any:
            return self.store.read(path) if path.suffix.lower() == PROJECT else read_to_add(path)

        self.editor.beside.begin(tr("Opening {0}", path.name), work, add, progress)

    def drop(self, paths: list[Path]) -> None:
        """Opens files that were dropped onto the window, up to one that asks something."""
        for path in paths:
            if not self.asking:
                self.attempt(lambda path=path: self.open(path))

    def chosen(self, path: Path) -> None:
        """A file was chosen in the dialogue.

        Raises:
            EnlivenError: if it cannot be read or written.
        """
        dialogue, self.asking = self.asking, ""
        if dialogue == "open":
            self.open(path)
        elif dialogue in ("export", "film"):
            self._export(path)
        elif dialogue == "perform":
            self.perform.connect_nearby("--loop", "--recording", str(path))
        elif dialogue == "session":
            save_session(self.editor.project, self.editor.selection.character or "", path)
            self.editor.toasts.say(
                tr("Saved {0}", path.name), tr("`enliven examples fit` plays it without a window.")
            )
        else:
            self.save(path)

    def go_on(self, *, discard: bool) -> None:
        """Goes on with the command that waited for unsaved work, with or without saving."""
        self.asking = ""
        if discard:
            self.store.forget()
            self._go_on()
            return
        self.perform.recording.stop()  # it becomes a part of what is saved
        if self.store.path is not None:
            self.attempt(self.save)
        else:
            self._browse("save as")

    def save(self, path: Path | None = None, *, over: bool = False) -> None:
        """Saves the project, and goes on with what waited for that; asks if another window saved its file.

        Args:
            path: the file that is the project's from then on; None: the one that it has.
            over: also where another window has saved the file since.

        Raises:
            EnlivenError: if it cannot be written; what waited does not go on later.
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
                self.preferences.opened(path)
            self._go_on()

    def ask_for_name(self) -> None:
        """Opens the dialogue that saves the project under another name; what waits goes on after it."""
        self._browse("save as")

    def compare(self) -> None:
        """Compares the project with the one that another window saved to its file."""
        self.attempt(lambda: setattr(self, "compared", self._differences()))

    def add_saved_items(self) -> None:
        """Adds the items to the project that only its file has, as one edit, and compares the two again."""

        def add() -> None:
            saved = self.store.saved_now()
            self.editor.edit("add what the file has", lambda project: with_saved_items(project, saved))

        if self.attempt(add):
            self.compare()

    def _differences(self) -> tuple[Difference, ...]:
        return compare_projects(self.editor.history.project, self.store.saved_now())

    def _begin_tour(self) -> None:
        """Begins the tour, or resume it where it was left; begins it again while it is taken."""
        number = 0 if self.tour is not None else self.preferences.tour_step
        self.starting, self.tour = False, Tour(self, self.drawn, number)

    def watch_tour(self, seconds: float, origin: tuple[float, float] = (0.0, 0.0)) -> None:
        """Lets the tour check its step; to be called once per frame.

        Args:
            seconds: since the last picture.
            origin: the top left of the picture, in the window's pixels.
        """
        if self.tour is None:
            return
        self.tour.watch(seconds, origin)
        number = 0 if self.tour.step is None else self.tour.number
        if number != self.preferences.tour_step:
            self.preferences.tour_step = number
            self.preferences.save()

    def end_tour(self) -> None:
        """Puts the tour away; it resumes where it was."""
        if self.tour is not None:
            self.tour.leave()
        self.tour, self.preferences.toured = None, True
        self.preferences.save()

    def cancel(self) -> None:
        """Closes the dialogue; nothing goes on."""
        self.asking, self._after, self._wanted = "", "", None

    def edit_pose(self, number: int) -> None:
        """Edits a key pose at its moment: playhead, tool and second view go there together."""
        puppet = self.puppets.puppet
        if puppet is not None and 0 <= number < len(puppet.poses):
            self._go_to(puppet, puppet.poses[number].take, puppet.poses[number].time)
            self.puppets.edit_pose(number)
            self._bring_into_view()

    def begin_pose(self, take: str, seconds: float) -> None:
        """Makes a key pose for a second of a take, and edits it."""
        clip, puppet = self.editor.project.takes[take], self.puppets.puppet
        frame = min(max(round(seconds / clip.step), 0), len(clip.turns) - 1)
        if puppet is not None:
            self._go_to(puppet, take, frame * clip.step)
            self.puppets.begin_pose(take, frame * clip.step)
            self._bring_into_view()

    def _go_to(self, puppet: Puppet, take: str, seconds: float) -> None:
        """The playhead to a second of a take, where the puppet plays it; the second view shows that take."""
        if self.input.tool.name != "puppet":
            self.input.take("puppet")
        self.puppets.accept()
        number = layer_of(puppet, self.editor.selection.layer, take)
        if number is not None:
            self.editor.select(layer=number)
            length = self.editor.project.takes[take].duration
            self.editor.scrub(puppet.layers[number].time_of(seconds, length))
        self.performer.show(take)

    def _bring_into_view(self) -> None:
        """Moves the camera to the puppet where it is not wholly in the picture: it may have walked away."""
        editor, standing = self.editor, self.puppets.shown
        if standing is None:
            return
        pixels = editor.lens.project(standing.vertices[:: max(len(standing.vertices) // 2000, 1)])[0]
        if not ((pixels >= 0) & (pixels <= editor.size)).all():
            box = standing.vertices.min(0), standing.vertices.max(0)
            editor.camera.frame(box, editor.size[0] / max(editor.size[1], 1.0), room=_ROOM)

    def attempt(self, command: Callable[[], object]) -> bool:
        """Calls a function; shows its EnlivenError as a message and return False if it raises one."""
        try:
            command()
        except EnlivenError as error:
            self.editor.toasts.complain(error)
            return False
        return True

    def widget(self, name: str) -> Rectangle:
        """Returns the rectangle where a widget was drawn last.

        Raises:
            InputError: if it has not been drawn.
        """
        if name not in self.widgets:
            known = ", ".join(sorted(self.widgets))
            what = f"there is no widget {name!r} on the screen"
            raise InputError(what, where="session", mend=f"Known: {known}.")
        return self.widgets[name]

    def remember(self, name: str) -> None:
        """Notes where the last widget is."""
        from imgui_bundle import imgui

        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self.widgets[name] = (low.x, low.y, high.x, high.y)
        self.drawn.note(name, self.widgets[name])
        if name in self.drawn.wanted and not self.drawn.left_alone:
            clip = imgui.get_window_draw_list()
            top, bottom = clip.get_clip_rect_min().y, clip.get_clip_rect_max().y
            if low.y < top or high.y > bottom:
                imgui.set_scroll_here_y(0.5)  # what the tour or a script means is scrolled into sight

    def _export(self, path: Path) -> None:
        """Writes the file in the background, since surfaces may have to be solved for it."""
        project, toasts = self.editor.project, self.editor.toasts
        characters, options = exportable(project), replace(self.exporting)
        length, progress = self.editor.length, WorkProgress()
        options.chosen(characters)
        options.checked_range(length)

        def tell(said: str) -> None:
            first, _, rest = said.partition(". ")
            toasts.say(first, rest)

        def work() -> str:
            return write_export(project, path, characters, options, length, progress)

        self.editor.beside.begin(tr("Writing {0}", path.name), work, tell, progress)

    def _browse(self, dialogue: str) -> None:
        folder = self.store.path.parent if self.store.path else Path.cwd()
        endings = {
            "open": (PROJECT, *MODELS, *MESHES, *TAKES, *PERFORMANCES, *SESSIONS, *SOUNDS),
            "save as": (PROJECT,),
            "export": EXPORTS,
            "film": (FILM,),
            "session": SESSIONS,
            "perform": (*PERFORMANCES, *TAKES),
        }[dialogue]
        puppet, unnamed = self.editor.puppets.puppet, self.store.path is None
        about_it = dialogue == "session" or (dialogue in ("export", "film") and unnamed)
        stem = puppet.id if puppet is not None and about_it else self.store.name
        opens = dialogue in ("open", "perform")
        name = "" if opens else f"{stem}{endings[0]}"
        own = self.store.path if dialogue == "save as" else None
        self.browser = FileBrowser(folder, endings, name, not opens, own)
        self.asking = dialogue

    def _go_on(self) -> None:
        """Runs the command that waited until the work was saved or given up."""
        after, self._after = self._after, ""
        wanted, self._wanted = self._wanted, None
        if after == "open" and wanted is not None:
            self.attempt(lambda: self.open(wanted))
        elif after:
            self.ask(after)


def _is_large(path: Path) -> bool:
    """Returns whether reading a file may take so long that the window must not wait for it."""
    try:
        return path.stat().st_size > _LARGE_BYTES
    except OSError:
        return False
