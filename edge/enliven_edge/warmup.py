"""Compiles every kernel of the recipe before the first frame is due: no frame waits for a compiler."""

from __future__ import annotations

import numpy as np

from enliven.body import Body
from enliven.camera import Intrinsics
from enliven.deformation.observed import Seen
from enliven.frames import DepthFrame
from enliven_edge.actor import Actor
from enliven_edge.stage import Stage
from enliven_edge.tracking.model import lengths_for_height
from enliven_edge.tracking.posture import Posture
from enliven_edge.tracking.ranges import standing
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.tracker import Tracker


def warm_up_tracking(settings: TrackerSettings | None = None) -> None:
    """Tracks a cardboard figure for a few frames, and an empty room."""
    tracker = Tracker(settings)
    for i in range(4):
        tracker.track(_cardboard_figure(i * 33_333_333))
        tracker.surfaces()
    empty = _cardboard_figure(0)
    tracker.track(DepthFrame(np.zeros_like(empty.depth), empty.intrinsics, 200_000_000, "warm-up"))


def warm_up_stage(actor: Actor) -> None:
    """Possesses a copy of the actor for a few frames."""
    stage = Stage([Actor(actor.character, actor.graph, actor.settings)])
    posture = Posture(np.array([0.0, 0.95, 0.0]), standing(elbow=1.5), lengths_for_height(1.75))
    body = Body(0, posture.joints(), np.ones(20))
    stage.perform([body], 0)
    stage.cues()
    try:
        stage.possess(actor.character.id)
    except Exception:  # a mesh out of reach is the performer's business, later, not the warm-up's
        return
    for i in range(3):
        moved = Body(0, body.joints + 0.01 * i, body.confidence * (1 - 0.1 * i))
        seen = Seen(moved.joints, np.tile([0.0, 0.0, 1.0], (20, 1)))
        stage.perform([moved], (i + 1) * 33_333_333, {0: seen})


def _cardboard_figure(time_ns: int) -> DepthFrame:
    """Head, trunk, arms and legs as flat boxes at 2.5 m before a wall, over a floor."""
    depth = np.full((240, 320), 4000, np.uint16)
    below = np.arange(160, 240) - 119.5
    depth[160:] = np.minimum(4000, 1000 * 262.5 / below).astype(np.uint16)[:, None]
    boxes = ((45, 70, 148, 172), (70, 130, 138, 182), (72, 135, 124, 136), (72, 135, 184, 196))
    for top, bottom, left, right in (*boxes, (130, 220, 140, 157), (130, 220, 163, 180)):
        depth[top:bottom, left:right] = 2500
    return DepthFrame(depth, Intrinsics(320, 240, 262.5, 262.5, 159.5, 119.5), time_ns, "warm-up")
