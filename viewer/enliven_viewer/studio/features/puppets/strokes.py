"""Small line drawings: a stick figure of the performer, and a dashed frame."""

from __future__ import annotations

import math

import numpy as np
from imgui_bundle import ImVec2, imgui

from enliven_viewer.studio.features.puppets.performer_view import PerformerFigure
from enliven_viewer.studio.features.puppets.thumbnails import SIDE
from enliven_viewer.studio.panel_layout import Area


def draw_stick_figure(draw_list: imgui.ImDrawList, figure: PerformerFigure, area: Area, colour: int) -> None:
    """Draws a stick figure from its front right, scaled so that its rest pose fits the area."""
    joints, parents, height = figure.joints, figure.skeleton.parents, figure.height
    across = joints[:, 0] * math.cos(SIDE) - joints[:, 2] * math.sin(SIDE)
    scale = area.height / (1.12 * height)
    xs = area.x + area.width / 2 + np.clip(across * scale, -area.width / 2, area.width / 2)
    ys = area.y + area.height - np.clip(joints[:, 1] * scale, 0.0, area.height)
    thick = max(1.3, 0.022 * area.height)
    for joint in range(1, len(joints)):
        up = int(parents[joint])
        if np.hypot(xs[joint] - xs[up], ys[joint] - ys[up]) > 0.6:
            draw_list.add_line(ImVec2(xs[up], ys[up]), ImVec2(xs[joint], ys[joint]), colour, thick)


def draw_dashed_rectangle(draw_list: imgui.ImDrawList, low: ImVec2, high: ImVec2, colour: int) -> None:
    """Draws a dashed rectangle."""
    step = 7.0
    for y in (low.y, high.y):
        for k in range(int((high.x - low.x) / step / 2) + 1):
            x = low.x + 2 * k * step
            draw_list.add_line(ImVec2(x, y), ImVec2(min(x + step, high.x), y), colour, 1.2)
    for x in (low.x, high.x):
        for k in range(int((high.y - low.y) / step / 2) + 1):
            y = low.y + 2 * k * step
            draw_list.add_line(ImVec2(x, y), ImVec2(x, min(y + step, high.y)), colour, 1.2)
