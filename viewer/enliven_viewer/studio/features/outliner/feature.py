"""Registers the outliner: its state, actions and panel."""

from __future__ import annotations

from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import Panel
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.features.outliner.actions import make_outliner_actions
from enliven_viewer.studio.features.outliner.outliner import Outliner
from enliven_viewer.studio.features.perform.session import PerformSession


def register(app: App) -> None:
    """Registers the outliner."""
    perform = app.state(PerformSession)
    outliner = app.add_state(Outliner(app.editor, lambda: perform.present))

    # The drawing module is imported late, so that a workspace without a window works without ImGui.
    def draw_panel(area: Area) -> None:
        from enliven_viewer.studio.features.outliner.panel import draw_outliner

        draw_outliner(app, outliner, area)

    app.actions.add(*make_outliner_actions(outliner))
    app.panels.append(Panel("outliner", draw_panel, place="outliner"))
