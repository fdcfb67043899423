"""Does an action in the real window: by its menu, or by its key."""

from __future__ import annotations

from imgui_bundle import imgui

from enliven_viewer.studio.actions import KEYS, Action


def by_menu(ctx: imgui.test_engine.TestContext, action: Action) -> None:
    """Click an action in its menu."""
    ctx.menu_click(f"##MainMenuBar/{action.place}")


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
