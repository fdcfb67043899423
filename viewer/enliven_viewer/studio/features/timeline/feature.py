"""Registers the timeline: its state, panel and actions, and the options of the selected layer."""

from __future__ import annotations

from enliven.document import RigBase
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import Panel
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.features.timeline.clip_commands import ClipCommands, make_clip_actions
from enliven_viewer.studio.features.timeline.take_commands import TakeCommands, make_take_actions
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.features.timeline.transport import make_transport_actions
from enliven_viewer.studio.puppets.coverage import CoverageCache


def register(app: App) -> None:
    """Registers the timeline."""
    editor = app.editor
    timeline = app.add_state(TimelineInput(editor, app.time_axis, app.state(CoverageCache)))
    timeline.rows.edit_pose, timeline.rows.begin_pose = app.open_key_pose, app.begin_key_pose

    # The drawing modules are imported late, so that a workspace without a window works without ImGui.
    def draw_panel(area: Area) -> None:
        from enliven_viewer.studio.features.timeline.panel import draw_timeline

        draw_timeline(app, timeline, area)

    def draw_layer_options(character: RigBase, number: int) -> None:
        from enliven_viewer.studio.features.timeline.layer_options import draw_layer

        draw_layer(app, timeline, character, number)

    app.actions.add(
        *make_clip_actions(ClipCommands(editor)),
        *make_take_actions(TakeCommands(editor)),
        *make_transport_actions(editor),
        after="tool.ends",
    )
    app.panels.append(Panel("timeline", draw_panel, place="bottom"))
    app.layer_sections.append(draw_layer_options)
    app.key_handlers.append(timeline.rows.type)
