"""Contributions of features to the studio: panels, overlays, layers of the 3D view, files, a live stage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import moderngl

from enliven.document import Project
from enliven_viewer.render.scene import Scene
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.viewport.viewport import RenderPass

Phase = Literal["idle", "counting", "recording"]
PanelPlace = Literal[
    "right",
    "outliner",
    "selection",
    "below outliner",
    "bottom",
    "above timeline",
    "beside view",
    "below view",
]


@dataclass(frozen=True)
class Panel:
    """A panel of the window. At the right, it replaces a workspace's usual panel.

    Attributes:
        name: a permanent name.
        draw: draws the panel in an area of the window.
        is_shown: returns whether the panel is open.
        workspaces: names of the workspaces that can show it; empty for all.
        back: name of the widget that closes it. The tour points at it if the panel hides its target.
        place: where the panel is; "selection" is below the outliner, in place of the usual
            properties; "below outliner" is below both.
    """

    name: str
    draw: Callable[[Area], object]
    is_shown: Callable[[], bool] = lambda: True
    workspaces: tuple[str, ...] = ()
    back: str = ""
    place: PanelPlace = "right"


@dataclass(frozen=True)
class ViewOverlay:
    """Flat marks and text over the 3D view, below all panels.

    Attributes:
        draw: draws the overlay in the area of the view.
        find_bottom: returns the distance in pixels from the top of the view to the bottom of its large text,
            so that other text is drawn below; 0 without text.
        find_lines_height: returns the height in pixels of its lines at the bottom of the view, so that
            messages are drawn above; 0 without lines.
    """

    draw: Callable[[Area], object]
    find_bottom: Callable[[], float] = lambda: 0.0
    find_lines_height: Callable[[], float] = lambda: 0.0


@dataclass(frozen=True)
class ViewLayer:
    """A layer of the 3D view.

    Attributes:
        make_pass: makes the render pass, with the window's OpenGL context.
        hides_characters: returns True if only this layer is drawn, without characters.
    """

    make_pass: Callable[[moderngl.Context], RenderPass]
    hides_characters: Callable[[], bool] = lambda: False


@dataclass(frozen=True)
class FileType:
    """A type of file that can be opened.

    Attributes:
        suffixes: its file extensions, with the dot.
        read: returns the content of a file. It may run in a thread.
        add: adds the content to the project.
    """

    suffixes: tuple[str, ...]
    read: Callable[[Path], Any]
    add: Callable[[Editor, Path, Any], None]


@dataclass(frozen=True)
class FileDialog:
    """A dialogue that opens a file.

    Attributes:
        title: its title.
        suffixes: the extensions of the offered files, with the dot.
        open: opens the chosen file.
    """

    title: str
    suffixes: tuple[str, ...]
    open: Callable[[Path], object]


@dataclass(frozen=True)
class LiveStageView:
    """A live stage that is shown together with the project's characters.

    Attributes:
        find_scene: returns the visible scene of the stage; None if there is none.
        find_replaced: returns the ids of the project's characters for which the scene shows live versions.
        find_held: returns the ids of the characters that performers control.
        put: puts a character of the project on the stage, now or once a stage is connected.
    """

    find_scene: Callable[[], Scene | None] = lambda: None
    find_replaced: Callable[[], frozenset[str]] = frozenset
    find_held: Callable[[], frozenset[str]] = frozenset
    put: Callable[[str], object] = lambda name: None


class TimelineRecording:
    """A recording onto the timeline, which counts as unsaved work while it runs. This base class never runs.

    Attributes:
        phase: the state: no recording, counting in, or running.
    """

    phase: Phase = "idle"

    @property
    def seconds(self) -> float:
        """Returns the recorded length in seconds."""
        return 0.0

    def stop(self, until_ns: int | None = None) -> None:
        """Ends the recording, and adds it to the project.

        Args:
            until_ns: time on the sensor's clock at which the recording is cut off; None keeps all of it.
        """

    def make_unfinished_edit(self) -> Callable[[Project], Project] | None:
        """Returns the edit that stores the unfinished recording, or None without a recording."""
        return None

    def discard(self) -> None:
        """Discards the recording."""


_UNKNOWN_AREA = Area(0.0, 0.0, 1.0, 1.0)


@dataclass
class Frame:
    """The frame that the window draws. The window sets it before the frame tasks.

    Attributes:
        elapsed_s: seconds since the previous frame.
        rate_hz: smoothed frame rate in frames per second.
        view: area of the 3D view in the window.
        plays_to_audience: True if the window shows only the performance, and runs unattended.
    """

    elapsed_s: float = 0.0
    rate_hz: float = 0.0
    view: Area = _UNKNOWN_AREA
    plays_to_audience: bool = False
