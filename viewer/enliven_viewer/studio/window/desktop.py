"""The window's connection to the desktop: its title, dropped files, and display scaling.

High-density screens and a larger text size are handled in the same way. The whole window is laid out in
logical pixels. Each of them covers several screen pixels. ImGui supports this for the screens of Macs. So
panels, views and pointer use logical pixels everywhere, and no other code depends on the scale.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import glfw
from imgui_bundle import ImVec2, imgui
from imgui_bundle.glfw_utils import glfw_window_hello_imgui

from enliven_viewer.studio.workspace.workspace import Workspace

PointerPosition = tuple[float, float]
"""Position in pixels from the window's top left corner."""
_MAX_POSITIONS = 4096
"""Maximum number of stored positions: four seconds of a mouse with 1000 events per second."""


class PointerPath:
    """The positions from the window's events. Each frame takes the positions up to ImGui's current position.
    ImGui processes moves and button changes in order, and stops at the next button change of a frame. Later
    positions are kept for the next frame, so that a stroke begins at the position of the button press.
    """

    def __init__(self) -> None:
        self._positions: list[PointerPosition] = []

    def add(self, x: float, y: float) -> None:
        """Adds the position of a pointer event, in whole pixels like ImGui's."""
        self._positions.append((float(math.floor(x)), float(math.floor(y))))
        del self._positions[:-_MAX_POSITIONS]

    def take_positions(self, at: PointerPosition) -> list[PointerPosition]:
        """Returns and removes the positions up to ImGui's current position ``at``, which comes last."""
        if at not in self._positions:
            # The pointer was moved without an event, for example by a test. So the older positions do not
            # belong to its path.
            self._positions.clear()
            return [at]
        end = self._positions.index(at) + 1
        positions, self._positions = self._positions[:end], self._positions[end:]
        return positions


_MIN_FINGER_JUMP_PX = 44.0
"""Minimum distance in pixels between two pointer events at which a press counts as a finger's. A mouse sends
at least 125 events per second, and moves slowly before its button is pressed.
"""


class FingerDetector:
    """Detects the presses of fingers. Only Windows reports them. On other systems a finger looks like a mouse
    that jumps to a place and is pressed there at once. After a jump, presses count as a finger's until the
    pointer moves without a pressed button.
    """

    def __init__(self) -> None:
        self._is_finger = False
        self._last: PointerPosition | None = None

    def update(
        self,
        positions: list[PointerPosition],
        *,
        is_pressed: bool,
        is_held: bool,
        is_touch_screen: bool = False,
    ) -> bool:
        """Returns True if a press in this frame is a finger's. Call once per frame.

        Args:
            positions: the pointer's positions since the previous frame, the current one last.
            is_pressed: True if the left button was pressed in this frame.
            is_held: True if the left button was held at any time since the previous frame.
            is_touch_screen: True if the system reports a touch screen.
        """
        path = [*([] if self._last is None else [self._last]), *positions]
        self._last = positions[-1]
        jump = max((math.dist(first, last) for first, last in itertools.pairwise(path)), default=0.0)
        if is_pressed:
            self._is_finger = self._is_finger or jump >= _MIN_FINGER_JUMP_PX
        elif jump > 0.0 and not is_held:
            self._is_finger = False
        return is_touch_screen or self._is_finger


_MIN_LAYOUT_SIZE = (640.0, 360.0)
"""Minimum layout size in logical pixels, so that large text in a small window stays usable."""


class Desktop:
    """The title, dropped files and scale of the studio's window. Created once the window is open."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace, self._title = workspace, ""
        self._window: Any = glfw_window_hello_imgui()
        self._dropped: list[Path] = []
        self.scale = self._find_density()
        self.path, self.fingers = PointerPath(), FingerDetector()
        glfw.set_drop_callback(self._window, self._handle_drop)
        self._install_pointer_callbacks()
        self._fit_to_screen()

    def update(self) -> None:
        """Opens dropped files, and updates the window title. Call once per frame."""
        dropped, self._dropped = self._dropped, []
        self._workspace.drop(dropped)
        title = self._workspace.store.title
        if title != self._title:
            self._title = title
            glfw.set_window_title(self._window, title)

    def lay_out(self) -> None:
        """Lays out the window in logical pixels. Call right after ImGui begins a new frame."""
        io, view = imgui.get_io(), imgui.get_main_viewport()
        raw, framebuffer_scale = io.display_size, io.display_framebuffer_scale
        scale = self._find_density() * self._workspace.preferences.text_size
        max_scale = min(raw.x / _MIN_LAYOUT_SIZE[0], raw.y / _MIN_LAYOUT_SIZE[1])
        self.scale = max(min(scale, max_scale), min(self._find_density(), 1.0))
        size, density = (
            ImVec2(raw.x / self.scale, raw.y / self.scale),
            ImVec2(framebuffer_scale.x * self.scale, framebuffer_scale.y * self.scale),
        )
        io.display_size = view.size = view.work_size = size
        io.display_framebuffer_scale = view.framebuffer_scale = density

    def _find_density(self) -> float:
        """Returns the number of window pixels per logical pixel. It is 1 on Macs, because their windows
        already use logical pixels.
        """
        dense = glfw.get_window_content_scale(self._window)[0]
        across = glfw.get_window_size(self._window)[0]
        return dense * across / max(glfw.get_framebuffer_size(self._window)[0], 1) if across else 1.0

    def _fit_to_screen(self) -> None:
        """Enlarges the window on a high-density screen, as far as the screen has room."""
        monitor = glfw.get_primary_monitor()
        if self.scale == 1.0 or not monitor:
            return
        work_area, settings = glfw.get_monitor_workarea(monitor), self._workspace.editor.settings
        size = (round(settings.width * self.scale), round(settings.height * self.scale))
        glfw.set_window_size(self._window, min(size[0], work_area[2]), min(size[1], work_area[3]))

    def _install_pointer_callbacks(self) -> None:
        """Converts pointer positions to logical pixels.

        The pointer stays in the window while a button is held.
        """
        library = glfw._glfw  # Use the C library directly, because only it can return ImGui's callbacks.
        old_callbacks: list[Any] = []

        def move(window: Any, x: float, y: float) -> None:
            old_callbacks[0](window, x / self.scale, y / self.scale)
            self.path.add(x / self.scale, y / self.scale)

        def enter(window: Any, inside: int) -> None:
            held = any(glfw.get_mouse_button(self._window, button) for button in range(3))
            if inside or not held:
                old_callbacks[1](window, inside)

        self._pointer_callbacks = (glfw._GLFWcursorposfun(move), glfw._GLFWcursorenterfun(enter))
        old_callbacks.append(library.glfwSetCursorPosCallback(self._window, self._pointer_callbacks[0]))
        old_callbacks.append(library.glfwSetCursorEnterCallback(self._window, self._pointer_callbacks[1]))

    def _handle_drop(self, window: object, paths: list[str]) -> None:
        self._dropped += [Path(path) for path in paths]
