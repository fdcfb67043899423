"""Registers scanning: its session, actions, panel, and the marks and the surface over the view."""

from __future__ import annotations

from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.contributions import Panel, ViewLayer, ViewOverlay
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.scan.actions import make_scan_actions
from enliven_viewer.studio.features.scan.advice import ADVICE_BOTTOM
from enliven_viewer.studio.features.scan.preview import ScanPreviewPass
from enliven_viewer.studio.features.scan.session import ScanSession


def register(app: App) -> None:
    """Registers scanning."""
    scan = app.add_state(ScanSession(app.editor, app.state(PerformSession)))

    # The drawing modules are imported late, so that a workspace without a window works without ImGui.
    def draw_panel(area: Area) -> None:
        from enliven_viewer.studio.features.scan.panel import draw_scan

        draw_scan(app, scan, area)

    def draw_open_button() -> None:
        from enliven_viewer.studio.features.scan.panel import draw_open_button

        draw_open_button(app)

    def draw_overlay(area: Area) -> None:
        from enliven_viewer.studio.features.scan.overlay import draw_scan_overlay

        draw_scan_overlay(app.editor.lens, scan, area)

    app.actions.add(*make_scan_actions(scan))
    app.panels.append(Panel("scan", draw_panel, lambda: scan.is_shown, ("Perform",), "scan back"))
    app.perform_sections.append(draw_open_button)
    app.overlays.append(ViewOverlay(draw_overlay, lambda: ADVICE_BOTTOM if scan.active else 0.0))
    app.view_layers.append(
        ViewLayer(lambda context: ScanPreviewPass(context, lambda: scan.surface), lambda: scan.active)
    )
    app.input.handles.append(scan)
    app.frame_tasks.append(scan.advance)
