"""What sessions in the real window share: a script of ImGui's test engine, and actions by menu and by key."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import hello_imgui, imgui

from enliven_viewer.studio.actions import KEYS, Action

PATIENCE = 900.0
"""Seconds that a script may take. After its usual minute the engine ends it: whatever it then does with mouse
and keys has no effect, without a word, which on a busy machine looks like a window that does not hear."""


def scripted(work: Callable[[imgui.test_engine.TestContext], None]) -> Callable[[], None]:
    """Returns what lets a window do a script from its first picture on: its ``register_tests``.

    A script that raises ends the window.
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
    """Click an action in its menu."""
    ctx.menu_click(menu_path(action.place))


def menu_path(place: str) -> str:
    """The test engine's path of an entry of the menus, such as "File/Save": English ids in any language."""
    return "/".join(["##MainMenuBar", *(f"###{part}" for part in place.split("/"))])


def by_key(ctx: imgui.test_engine.TestContext, action: Action) -> None:
    """Press the first key of an action."""
    press(ctx, action.keys[0])


def press(ctx: imgui.test_engine.TestContext, key: str) -> None:
    """Press a key by its name, such as "ctrl+shift+z"."""
    *modifiers, name = key.split("+")
    chord = int(KEYS[name])
    for modifier in modifiers:
        chord |= int(getattr(imgui.Key, f"mod_{modifier}"))
    ctx.key_press(chord)
    ctx.yield_()
