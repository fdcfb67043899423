"""Opens the studio's window at a screen density and text size. Prints the positions of widgets as JSON.

Arguments: a folder, dots per inch, width and height in pixels at normal density, text size, and optionally an
image file to write.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import json
import os
import sys
from pathlib import Path

import glfw
from imgui_bundle import imgui
from imgui_bundle.glfw_utils import glfw_window_hello_imgui

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from made_acting_stage import acting_stage

from enliven_viewer.studio.window.window import StudioWindow

report: dict[str, object] = {}
X11 = ctypes.CDLL(ctypes.util.find_library("X11") or "libX11.so.6")
X11.XOpenDisplay.restype = ctypes.c_void_p
X11.XDefaultRootWindow.restype = ctypes.c_ulong
SERVER = ctypes.c_void_p(X11.XOpenDisplay(os.environ["DISPLAY"].encode()))
ROOT = ctypes.c_ulong(X11.XDefaultRootWindow(SERVER))


def dense(dpi: int) -> None:
    """Sets the density of the screen in the X server's resources, as a desktop does."""
    text = f"Xft.dpi:\t{dpi}\n".encode()
    manager = ctypes.c_ulong(X11.XInternAtom(SERVER, b"RESOURCE_MANAGER", 0))
    X11.XChangeProperty(SERVER, ROOT, manager, ctypes.c_ulong(31), 8, 0, text, len(text))
    X11.XSync(SERVER, 0)


def warp(x: float, y: float) -> None:
    """Moves the real pointer to a pixel of the screen. The window is at the screen's corner."""
    left, top = glfw.get_window_pos(glfw_window_hello_imgui())
    X11.XWarpPointer(SERVER, ctypes.c_ulong(0), ROOT, 0, 0, 0, 0, round(left + x), round(top + y))
    X11.XSync(SERVER, 0)


def main() -> None:
    folder, (dpi, wide, high) = Path(sys.argv[1]), map(int, sys.argv[2:5])
    dense(dpi)
    workspace = acting_stage(folder, wide, high)
    workspace.preferences.text_size = float(sys.argv[5])
    window = StudioWindow(workspace)

    def after(window: StudioWindow) -> None:
        own = glfw_window_hello_imgui()
        io = imgui.get_io()
        if window.pictures == 4:
            report["window"] = list(glfw.get_window_size(own))
            report["usual"] = [io.display_size.x, io.display_size.y]
            report["scale"] = window.desktop.scale
            left, top, right, bottom = workspace.widget("tool carry")
            place = (left + right) / 2, (top + bottom) / 2
            report["aimed"] = list(place)
            warp(place[0] * window.desktop.scale, place[1] * window.desktop.scale)
        elif window.pictures == 20:
            report["pointer"] = [io.mouse_pos.x, io.mouse_pos.y]
            pixels = window.pixels()
            report["picture"] = [pixels.shape[1], pixels.shape[0]]
            report["widgets"] = workspace.widgets
            if len(sys.argv) > 6:
                from PIL import Image

                Image.fromarray(pixels).save(sys.argv[6])
            workspace.store.forget()
            window.close()

    workspace.editor.select_only("limb")
    window.run(seconds=100, after=after)
    print(json.dumps(report))


if __name__ == "__main__":
    main()
