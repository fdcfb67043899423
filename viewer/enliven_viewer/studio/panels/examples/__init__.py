"""The panels of example poses: control points, the strip of key poses, motion and settings."""

from enliven_viewer.studio.panels.examples.motion import told
from enliven_viewer.studio.panels.examples.panel import draw_examples
from enliven_viewer.studio.panels.examples.performer import draw_performer
from enliven_viewer.studio.panels.examples.strip import draw_strip

__all__ = ["draw_examples", "draw_performer", "draw_strip", "told"]
