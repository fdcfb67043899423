"""Opens the kiosk's real window, presses keys, and prints the results.

Arguments: profile, folder.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import glfw
import numpy as np

from enliven.errors import ResourceError
from enliven.kiosk.profile import load_profile
from enliven.kiosk.screen_lock import ScreenLock
from enliven.supervision.records import SCREEN_PICTURE_FILE, read_services, runtime_folder
from enliven_viewer.kiosk.window import QUIT_MODIFIERS, KioskWindow, run_kiosk_window


def main(path: Path, folder: Path) -> None:
    os.environ["ENLIVEN_RUNTIME"] = str(folder)
    profile = load_profile(path)
    window = KioskWindow(profile, path.parent)
    report: dict[str, object] = {"size": window.size}
    glfw_window = window._window
    report["decorated"] = bool(glfw.get_window_attrib(glfw_window, glfw.DECORATED))
    report["cursor_hidden"] = glfw.get_input_mode(glfw_window, glfw.CURSOR) == glfw.CURSOR_HIDDEN
    for _ in range(3):
        window.draw(0.1)
    first = window.pixels()
    report["picture"] = first.shape[:2]
    window.press(glfw.KEY_ESCAPE)
    glfw.set_window_should_close(glfw_window, True)
    for _ in range(10):
        window.draw(0.1)
    report["closes_by_escape"] = window.is_closing or bool(glfw.window_should_close(glfw_window))
    report["changed"] = float(np.abs(window.pixels().astype(int) - first).mean())
    window.press(glfw.KEY_Q)
    report["closes_by_q"] = window.is_closing
    window.press(glfw.KEY_Q, QUIT_MODIFIERS)
    report["closes_by_all_three"] = window.is_closing
    report["gl_error"] = str(window._ctx.error)
    window.close()
    report["picture_of_screen"] = (runtime_folder() / SCREEN_PICTURE_FILE).is_file()
    report["service"] = [record.name for record in read_services()]
    lock = ScreenLock(profile.screen.number)
    try:
        run_kiosk_window(profile, path.parent, 1.0)
    except ResourceError as error:
        report["second"] = str(error)
    lock.close()
    print(json.dumps(report))


main(Path(sys.argv[1]), Path(sys.argv[2]))
