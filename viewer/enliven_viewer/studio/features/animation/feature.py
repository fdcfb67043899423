"""Registers the curve editor with its panel, and the view layer of ghosts and trails, with their states and
actions.
"""

from __future__ import annotations

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import Panel, ViewLayer
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.features.animation.curve_input import CurveInput
from enliven_viewer.studio.features.animation.ghost_pass import GhostPass
from enliven_viewer.studio.features.animation.ghosts import Ghosts


def register(app: App) -> None:
    """Registers curves, ghosts and trails."""
    ghosts = app.add_state(Ghosts(app.editor))
    curves = app.add_state(CurveInput(app.editor, app.time_axis))

    def draw_curve_panel(area: Area) -> None:
        # Imported late, so that a workspace without a window works without ImGui.
        from enliven_viewer.studio.features.animation.curve_panel import draw_curves

        draw_curves(app, curves, area)

    app.actions.add(_make_ghost_action(ghosts), _make_curve_action(curves))
    app.panels.append(Panel("curves", draw_curve_panel, lambda: curves.is_shown, place="above timeline"))
    app.key_handlers.append(curves.handle_key)
    app.view_layers.append(ViewLayer(lambda context: GhostPass(context, ghosts)))


def _make_ghost_action(ghosts: Ghosts) -> Action:
    return Action(
        "view.ghosts",
        "View",
        "Ghosts and trails",
        ("shift+g",),
        ghosts.toggle,
        is_on=lambda: ghosts.is_shown,
        about=(
            "Shows past (blue) and future (orange) poses of the chosen shape, and the paths of its hands "
            "and feet."
        ),
        apart=True,
    )


def _make_curve_action(curves: CurveInput) -> Action:
    return Action(
        "view.curves",
        "View",
        "Curves",
        ("shift+c",),
        curves.toggle,
        is_on=lambda: curves.is_shown,
        about="Shows curves of rotation, position, keys, weight and speed over time, above the timeline.",
    )
