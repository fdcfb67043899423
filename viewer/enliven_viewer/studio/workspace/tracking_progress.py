"""The progress of the tracker for an opened depth recording, in the timeline's transport."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from enliven_viewer.language import labelled, tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.workspace.depth_tracking import DepthTracking


def draw_tracking_progress(app: App, depth: DepthTracking) -> None:
    """Draws the progress of the tracker for an opened depth recording, and a stop button."""
    depth.poll()
    if not depth.busy:
        return
    imgui.same_line(0.0, 18.0)
    imgui.progress_bar(depth.share, ImVec2(220, 0), f"{depth.name}  {100 * depth.share:.0f} %")
    imgui.same_line()
    if imgui.button(labelled(tr("Stop"), "stop tracking")):
        depth.cancel()
    app.remember("stop tracking")
