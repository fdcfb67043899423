"""Registers performing: the link to a stage, its actions, and the Perform panel."""

from __future__ import annotations

from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import Panel
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.features.perform.actions import make_perform_actions
from enliven_viewer.studio.features.perform.session import PerformSession


def register(app: App) -> None:
    """Registers performing."""
    perform = app.add_state(PerformSession(app.editor, app.folder))

    # The drawing module is imported late, so that a workspace without a window works without ImGui.
    def draw_panel(area: Area) -> None:
        from enliven_viewer.studio.features.perform.panel import draw_perform

        draw_perform(app, area)

    app.actions.add(*make_perform_actions(perform))
    app.actions.workspace = lambda: perform.shortcut_workspace
    app.panels.append(Panel("perform", draw_panel, workspaces=("Perform",)))
