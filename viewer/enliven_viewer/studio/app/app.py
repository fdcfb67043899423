"""The application interface for features: the registry of everything that features add to the studio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from enliven.document import RigBase
from enliven.errors import EnlivenError, InputError
from enliven_viewer.language import tr
from enliven_viewer.render.scene import Scene
from enliven_viewer.studio.actions.table import ActionTable
from enliven_viewer.studio.app.contributions import (
    FileDialog,
    FileType,
    Frame,
    LiveStageView,
    Panel,
    PanelPlace,
    TimelineRecording,
    ViewLayer,
    ViewOverlay,
)
from enliven_viewer.studio.app.file_browser import FileBrowser
from enliven_viewer.studio.app.panel_layout import Area, PanelLayout, SideSplit
from enliven_viewer.studio.app.targets import DrawnWidgets, Rectangle
from enliven_viewer.studio.app.time_axis import TimeAxis
from enliven_viewer.studio.app.viewport_input import ViewportInput, make_tool_action
from enliven_viewer.studio.app.workspace_tabs import WorkspaceTabs
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.editor.selection_transform import SelectionTransform
from enliven_viewer.studio.preferences import Preferences
from enliven_viewer.studio.tools.base import Tool
from enliven_viewer.studio.viewport.stage_character import StageCharacter
from enliven_viewer.studio.viewport.viewport import Viewport

State = TypeVar("State")
ToolKind = TypeVar("ToolKind", bound=Tool)


class App:
    """The registry of features. ``register(app)`` of each feature adds to it when the studio starts.

    Args:
        editor: the editor of the project.
        folder: the folder of the preferences; None for the user's default folder.

    Attributes:
        asking: name of the open dialogue, or empty.
        browser: the state of a file dialogue.
        starting: True to show the start page while the project is empty.
        tabs: the choice of the workspace.
        preferences: the artist's lasting preferences.
        actions: every action, for menus, shortcuts, buttons and the command palette.
        input: the input over the view; its ``handles`` take precedence over the active tool.
        time_axis: the visible span of time of the timeline, curves and sounds.
        selection_transform: position and size of the selection. typing: unfinished text in their fields.
        open_key_pose: opens a key pose of the selected puppet by its number.
        begin_key_pose: begins a key pose of the selected puppet at a time of a take.
        show_take: shows a take next to the characters, by its name.
        live: the live stage that is shown together with the project's characters.
        recording: the recording onto the timeline.
        frame: the frame that the window draws.
        side_split: the division of the right panel.
        panels: panels around the view.
        tool_options: functions that draw the options of a tool in the right panel, by the tool's name.
        perform_sections: functions that draw a section of the Perform panel.
        layer_sections: functions that draw options of the selected layer in the right panel. They take its
            character and its number.
        transport_sections: functions that draw controls next to the timeline's play buttons.
        panel_pictures: functions that take the view of small images. They return a function that draws
            the images of panels, once per frame. The function of the first feature draws last.
        overlays: marks and text over the view.
        audience_overlays: functions that draw over the view of a window that shows only the performance.
        window_overlays: functions that draw over all panels and dialogues.
        hidden_panels: functions that return the names of panels to hide in addition to the workspace's.
        view_layers: geometry in the 3D view.
        ruler_layers: functions that draw on the timeline's ruler. They take its left and top in pixels.
        file_types: the types of files that can be opened.
        file_dialogs: dialogues that open a file, by the name that :meth:`ask` takes.
        frame_tasks: functions called once per frame, before the frame is drawn.
        activity_checks: functions that return True while the window must draw at the full frame rate.
        input_blocks: functions that return True while the view must not receive input.
        wants_start_page: returns True to show the start page over any project, False to leave an empty view
            without text, or None.
        key_handlers: functions called with each key before the tool. They return True if they have handled
            the key.
        closing_tasks: functions called when the window closes, last one first.
        widgets: the last drawn rectangle of each widget, by name, so that a scripted session can click it.
        drawn: the same rectangles, with the frame in which each was drawn, for the tour.
    """

    def __init__(self, editor: Editor, folder: Path | None = None) -> None:
        self.editor, self.folder, self.asking = editor, folder, ""
        self.browser: FileBrowser | None = None
        self.starting, self.tabs = False, WorkspaceTabs()
        self.preferences = Preferences(folder)
        self.actions = ActionTable(editor.toasts, self.preferences)
        self.input = ViewportInput(editor, self.actions)
        self.time_axis = TimeAxis(editor)
        self.selection_transform, self.typing = SelectionTransform(editor), dict[str, str]()
        self.open_key_pose: Callable[[int], object] = lambda number: None
        self.begin_key_pose: Callable[[str, float], object] = lambda take, time: None
        self.show_take: Callable[[str], object] = lambda name: None
        self.wants_start_page: Callable[[], bool | None] = lambda: None
        self.live, self.recording, self.frame = LiveStageView(), TimelineRecording(), Frame()
        self.side_split = SideSplit()
        self.panels: list[Panel] = []
        self.tool_options: dict[str, Callable[[], object]] = {}
        self.perform_sections: list[Callable[[], object]] = []
        self.layer_sections: list[Callable[[RigBase, int], object]] = []
        self.transport_sections: list[Callable[[], object]] = []
        self.panel_pictures: list[Callable[[Viewport], Callable[[], object]]] = []
        self.overlays: list[ViewOverlay] = []
        self.audience_overlays: list[Callable[[Area], object]] = []
        self.window_overlays: list[Callable[[PanelLayout], object]] = []
        self.hidden_panels: list[Callable[[], tuple[str, ...]]] = []
        self.view_layers: list[ViewLayer] = []
        self.ruler_layers: list[Callable[[float, float], object]] = []
        self.file_types: list[FileType] = []
        self.file_dialogs: dict[str, FileDialog] = {}
        self.frame_tasks: list[Callable[[], object]] = []
        self.activity_checks: list[Callable[[], bool]] = []
        self.input_blocks: list[Callable[[], bool]] = []
        self.key_handlers: list[Callable[[str], bool]] = []
        self.closing_tasks: list[Callable[[], object]] = []
        self.widgets: dict[str, Rectangle] = {}
        self.drawn = DrawnWidgets()
        self._states: dict[type, object] = {}

    def add_state(self, state: State) -> State:
        """Adds the state of a feature, which :meth:`state` finds by its class. Returns it.

        Raises:
            InputError: if there is a state of this class already.
        """
        name = type(state).__name__
        if type(state) in self._states:
            problem, remedy = tr("this state exists already"), tr("Register the feature only once.")
            raise InputError(problem, where=f"state {name}", remedy=remedy)
        self._states[type(state)] = state
        return state

    def state(self, kind: type[State]) -> State:
        """Returns the state of a feature.

        Raises:
            InputError: if its feature is not registered.
        """
        state = self._states.get(kind)
        if not isinstance(state, kind):
            remedy = tr("Register the feature of this state first: see studio/features/registry.py.")
            raise InputError(
                tr("no feature has added this state"), where=f"state {kind.__name__}", remedy=remedy
            )
        return state

    def add_tool(self, kind: type[ToolKind], after: str = "") -> ToolKind:
        """Adds a tool to the toolbar and its key to the shortcuts. Returns the tool.

        Args:
            kind: the class of the tool.
            after: name of the tool that it follows; empty for the end.

        Raises:
            InputError: if its name or key is taken.
        """
        self.actions.add(make_tool_action(self.input, kind), after=after and f"tool.{after}")
        tool = kind(self.editor)
        self.input.tools[kind.name] = tool
        return tool

    def find_panel(self, workspace: str, place: PanelPlace = "right") -> Panel | None:
        """Returns the open panel of a workspace in a place, the last one added; None if there is none."""
        panels = (panel for panel in reversed(self.panels) if panel.place == place)
        panels = (panel for panel in panels if not panel.workspaces or workspace in panel.workspaces)
        return next((panel for panel in panels if panel.is_shown()), None)

    @property
    def shown_characters(self) -> list[StageCharacter]:
        """Returns the characters of the project that are visible on the stage."""
        if self._hides_characters:
            return []
        replaced = self.live.find_replaced()
        return [character for character in self.editor.visible_characters if character.id not in replaced]

    @property
    def shown_scene(self) -> Scene | None:
        """Returns the live scene if it is visible."""
        live = self.live.find_scene()
        if live is None or not self._hides_characters:
            return live
        return replace(live, actors=(), boards={})

    @property
    def _hides_characters(self) -> bool:
        """Returns True if a feature hides the characters, for example to show a growing scan."""
        return any(layer.hides_characters() for layer in self.view_layers)

    @property
    def is_saved(self) -> bool:
        """Returns True if the project has a file without unsaved changes. False without a workspace."""
        return False

    def open_dialogue(self, name: str) -> None:
        """Opens a dialogue. The workspace has the dialogues; an application alone has none."""

    def finish_file_dialog(self, path: Path) -> None:
        """Handles the file that was chosen in the dialogue."""

    def run_and_report(self, command: Callable[[], object]) -> bool:
        """Calls a function. If it raises an EnlivenError, shows the error as a message and returns False."""
        try:
            command()
        except EnlivenError as error:
            self.editor.toasts.show_error(error)
            return False
        return True

    def widget(self, name: str) -> Rectangle:
        """Returns the rectangle in which a widget was last drawn.

        Raises:
            InputError: if the widget has not been drawn.
        """
        if name not in self.widgets:
            widget_names = ", ".join(sorted(self.widgets))
            problem = f"no widget {name!r} is on the screen"
            raise InputError(problem, where="session", remedy=f"Known: {widget_names}.")
        return self.widgets[name]

    def remember(self, name: str) -> None:
        """Records the rectangle of the last widget."""
        from imgui_bundle import (
            imgui,  # Imported here, because a workspace without a window does not need it.
        )

        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self.widgets[name] = (low.x, low.y, high.x, high.y)
        self.drawn.record(name, self.widgets[name])
        if name in self.drawn.targets and not self.drawn.is_user_scrolling:
            clip = imgui.get_window_draw_list()
            top, bottom = clip.get_clip_rect_min().y, clip.get_clip_rect_max().y
            if low.y < top or high.y > bottom:
                imgui.set_scroll_here_y(0.5)  # Scroll to the widget at which the tour or a script points.
