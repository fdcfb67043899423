"""Helpers for sessions in the real window: scripts for ImGui's test engine, and actions by menu and by
key.
"""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import hello_imgui, imgui

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.actions.imgui_keys import KEYS

PATIENCE = 900.0
"""Timeout of a script in seconds.

The engine's default is one minute. After it, mouse and key input has no effect and no error is raised, which
looks like an unresponsive window on a busy machine.
"""


def scripted(work: Callable[[imgui.test_engine.TestContext], None]) -> Callable[[], None]:
    """Returns a window's ``register_tests`` that runs a script from the first frame on.

    If a script raises an error, the window closes.
    """

    def guarded(ctx: imgui.test_engine.TestContext) -> None:
        try:
            work(ctx)
        except BaseException:
            hello_imgui.get_runner_params().app_shall_exit = True
            raise

    def register() -> None:
        engine = hello_imgui.get_imgui_test_engine()
        how = imgui.test_engine.get_io(engine)
        how.config_run_speed = imgui.test_engine.TestRunSpeed.fast
        how.config_watchdog_warning = how.config_watchdog_kill_test = PATIENCE
        test = imgui.test_engine.register_test(engine, "window", "script")
        test.test_func = guarded
        imgui.test_engine.queue_test(engine, test)

    return register


def by_menu(ctx: imgui.test_engine.TestContext, action: Action) -> None:
    """Clicks an action in its menu."""
    ctx.menu_click(menu_path(action.place))


def menu_path(place: str) -> str:
    """Returns the test engine's path of a menu entry, such as "File/Save". The ids are English in any
    language.
    """
    return "/".join(["##MainMenuBar", *(f"###{part}" for part in place.split("/"))])


def by_key(ctx: imgui.test_engine.TestContext, action: Action) -> None:
    """Presses the first key of an action."""
    press(ctx, action.keys[0])


def press(ctx: imgui.test_engine.TestContext, key: str) -> None:
    """Presses a key by its name, such as "ctrl+shift+z"."""
    *modifiers, name = key.split("+")
    chord = int(KEYS[name])
    for modifier in modifiers:
        chord |= int(getattr(imgui.Key, f"mod_{modifier}"))
    ctx.key_press(chord)
    ctx.yield_()
