"""Registers puppets: their tool and actions, the second view, and the panels of the edited puppet."""

from __future__ import annotations

from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import Panel
from enliven_viewer.studio.features.puppets.key_pose_navigator import KeyPoseNavigator
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.features.puppets.puppet_commands import (
    PuppetCommands,
    make_pose_display_actions,
    make_puppet_actions,
)
from enliven_viewer.studio.features.puppets.puppet_panels import PuppetPanels
from enliven_viewer.studio.features.puppets.puppet_tool import PuppetTool
from enliven_viewer.studio.puppets.coverage import CoverageCache
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor


def register(app: App) -> None:
    """Registers puppets."""
    get_puppet_editor(app.editor)  # This call registers the editor of puppets.
    app.add_state(CoverageCache())
    view, commands = app.add_state(PerformerView(app.editor)), app.add_state(PuppetCommands(app.editor))
    poses, panels = app.add_state(KeyPoseNavigator(app.input, view)), PuppetPanels(app, view)
    app.open_key_pose, app.begin_key_pose = poses.edit, poses.begin
    app.add_tool(PuppetTool, after="map")
    app.actions.add(*make_puppet_actions(commands), after="shape.solve")
    app.actions.add(*make_pose_display_actions(commands), after="view.bones")
    app.panel_pictures.append(panels.make_pictures)
    app.panels += (
        Panel("performer", panels.draw_performer, panels.is_shown, place="beside view"),
        Panel("strip", panels.draw_strip, panels.is_shown, place="below view"),
        Panel("examples", panels.draw_options, panels.is_shown, place="selection"),
    )
