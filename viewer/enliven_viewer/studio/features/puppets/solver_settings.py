"""Sliders for the settings of the three solvers, each with its description."""

from __future__ import annotations

import dataclasses

from imgui_bundle import ImVec2, imgui

from enliven.document import ExampleCharacter
from enliven_viewer.language import labelled, later, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.fields import Change, draw_slider, draw_switch, draw_tooltip
from enliven_viewer.studio.app.style import push_colours
from enliven_viewer.studio.puppets.example_edits import with_default_settings, with_setting
from enliven_viewer.theme import PRESSED, RAISED

SETTING_SLIDERS = (
    ("surface", "squash_and_stretch", later("squash and stretch"), 0.0, 1.0, ""),
    ("surface", "exaggeration", later("exaggeration"), 0.0, 3.0, later("exaggerate %.2f")),
    ("surface", "hold", later("hold"), 0.0, 2.0, later("hold %.2f")),
    ("surface", "volume", later("volume"), 0.0, 1.0, later("keep %.2f of the volume")),
    ("examples", "acceleration", later("smooth"), 0.0, 2.0, later("smooth %.2f")),
    ("examples", "nearest", later("nearest"), 1, 12, later("mix %d examples")),
    ("locomotion", "plant", later("plant"), 0.0, 1.0, later("plant feet %.2f")),
)
"""The sliders: (group, field, label, minimum, maximum, number format)."""


def draw_settings(app: App, puppet: ExampleCharacter) -> None:
    """Draws the sliders, initially collapsed."""
    imgui.dummy(ImVec2(0, 4))
    with push_colours(RAISED, imgui.Col_.header), push_colours(PRESSED, imgui.Col_.header_hovered):
        opened = imgui.collapsing_header(labelled(tr("Settings"), "Settings"))
    app.remember("settings")
    if not opened:
        return
    for group, name, label, low, high, pattern in SETTING_SLIDERS:
        settings, change = getattr(puppet, group), _make_change(puppet.id, group, name)
        value = getattr(settings, name)
        if isinstance(value, bool):
            draw_switch(app, label, value, change, _wrap_description(settings, name))
        else:
            draw_slider(app, f"setting {label}", value, low, high, pattern, change)
            draw_tooltip(_wrap_description(settings, name))
    if imgui.button(labelled(tr("Reset"), "Reset")):
        app.editor.edit("reset settings", lambda project: with_default_settings(project, puppet.id))
    app.remember("reset settings")


def _make_change(puppet: str, group: str, name: str) -> Change:
    """Returns the edit that sets a setting."""
    return lambda project, value: with_setting(project, puppet, group, name, value)


def get_description(settings: object, name: str) -> str:
    """Returns the English description of a setting."""
    field = next(f for f in dataclasses.fields(settings) if f.name == name)  # type: ignore[arg-type]
    return str(field.metadata.get("doc", ""))


def _wrap_description(settings: object, name: str) -> str:
    """Returns the description of a setting, broken into lines."""
    words, lines = tr(get_description(settings, name)).split(), [""]
    for word in words:
        if len(lines[-1]) + len(word) > 56:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)
