"""Draws the right panel: the properties of the selection and of its layer."""

from __future__ import annotations

from imgui_bundle import imgui

from enliven.document import RigBase, RiggedCharacter
from enliven.mapping.model_clips import find_played_clip, list_own_clips, play_own_clip
from enliven_viewer.language import Texts, later, tr, tr_n
from enliven_viewer.studio.app.fields import draw_action_button, draw_character_name, draw_tooltip
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.app.style import draw_heading, draw_note, open_panel
from enliven_viewer.studio.app.transform_fields import draw_transform_fields
from enliven_viewer.studio.workspace.workspace import Workspace

_BUTTON_WIDTH = 126.0
"""Width of a button in pixels. Two buttons fit side by side."""
_CHARACTER_ACTIONS = (
    "edit.duplicate",
    "shape.mirror",
    "shape.larger",
    "shape.smaller",
    "shape.turn_left",
    "shape.turn_right",
)
_SELECTION_ACTIONS = (
    *_CHARACTER_ACTIONS,
    "motion.earlier",
    "motion.later",
    "motion.mute",
    "shape.hide",
    "shape.lock",
    "edit.delete",
)
"""Actions on the whole selection."""
_NO_CLIP, _OTHER_MOTION = later("no clip"), later("other motion")
"""Labels of the clip field if none of the model's clips plays."""
_BONE_ACTIONS = ("motion.spread", "motion.clear")
"""Actions of characters with bones only."""
_KIND_LABELS = Texts({"possessed mesh": "possessed character", "puppet": "puppet", "shape": "shape"})
"""Displayed names of the kinds of characters, by the rig's name for them."""


def draw_side(workspace: Workspace, area: Area) -> None:
    """Draws the right panel."""
    editor = workspace.editor
    with open_panel("side", area):
        chosen = editor.find_selected()
        several = editor.selection.has_several
        draw_options = workspace.tool_options.get(workspace.input.tool.name)
        if several:
            _draw_several_actions(workspace)
        elif draw_options is not None:
            draw_options()
        elif chosen is not None:
            _draw_selection(workspace, chosen)
        chosen, layer = editor.find_selected(), editor.selection.layer
        if chosen is not None and layer is not None and not several:
            for draw_section in workspace.layer_sections:
                draw_section(chosen, layer)


def _draw_selection(workspace: Workspace, character: RigBase) -> None:
    editor = workspace.editor
    draw_heading(tr("Chosen {0}", _KIND_LABELS.get(character.word, character.word)))
    draw_character_name(workspace, character)
    if editor.find_selected() is not character:
        return
    jointed = bool((character.parents >= 0).any())
    draw_note(describe_parts(character))
    if isinstance(character, RiggedCharacter):
        _draw_clips(workspace, character)
    draw_transform_fields(workspace)
    _draw_buttons(workspace, (*_CHARACTER_ACTIONS, *_BONE_ACTIONS) if jointed else _CHARACTER_ACTIONS)


def describe_parts(character: RigBase) -> str:
    """Returns a text with the number of a character's bones or parts, and a note if it lacks a surface."""
    bones = int((character.parents >= 0).sum())
    parts = [tr_n("{0} bone", "{0} bones", bones) if bones else tr("no bones: bends anywhere")]
    if character.mesh is None or not len(character.mesh.vertices):
        parts.append(tr("no surface"))
    return ", ".join(parts)


def _draw_clips(workspace: Workspace, shape: RiggedCharacter) -> None:
    """Draws the selection of a model's own clips."""
    editor = workspace.editor
    names = list_own_clips(editor.project, shape)
    if not names:
        return
    played_clip, moved = find_played_clip(editor.project, shape), bool(shape.layers)
    imgui.set_next_item_width(-1)
    if imgui.begin_combo("##clip", tr("Plays {0}", played_clip or (_OTHER_MOTION if moved else _NO_CLIP))):
        for name in (None, *names):
            label = name or _NO_CLIP
            is_pressed, _ = imgui.selectable(f"{tr(label)}###clip {label}", name == played_clip)
            if is_pressed and (name != played_clip or moved):
                _play_clip(workspace, shape.id, name)
            workspace.remember(f"play {name or 'none'}")
        imgui.end_combo()
    workspace.remember("clip")
    draw_tooltip("Clip of the model that plays instead of the shape's other motion. Keys still apply")


def _play_clip(workspace: Workspace, name: str, clip: str | None) -> None:
    """Makes a shape play one of its clips, or none."""
    step = later("play {0}", clip) if clip else later("play no clip")
    workspace.editor.edit(step, lambda project: play_own_clip(project, name, clip))


def _draw_several_actions(workspace: Workspace) -> None:
    """Draws the actions on several characters at once."""
    names = workspace.editor.selection.characters
    draw_heading(tr("{0} shapes are chosen", len(names)))
    draw_note(", ".join(names))
    draw_transform_fields(workspace)
    _draw_buttons(workspace, _SELECTION_ACTIONS)


def _draw_buttons(workspace: Workspace, actions: tuple[str, ...]) -> None:
    for place, action in enumerate(actions):
        if place % 2:
            imgui.same_line()
        draw_action_button(workspace, action, _BUTTON_WIDTH)
