"""Measures how soon a kiosk turns to a visitor, from the edge's message to the drawn image."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from pathlib import Path

from figure import Figure
from kiosk_visitors import StagedKiosk, SyntheticVisitor

from enliven.kiosk.profile import KioskCharacter, KioskProfile
from enliven_viewer.kiosk.painter import Painter
from enliven_viewer.kiosk.show import KioskShow
from enliven_viewer.kiosk.stage_link import KioskLink
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.render.gl.context import create_offscreen_context

SIZE = (1280, 720)
VISITS = 9
TURNED = 0.35
"""Rotation in radians that counts as a turn to the visitor. These 20 degrees are noticeable."""
EMPTY_S = 4.0
"""Seconds without visitors between two visits, longer than the farewell to a visitor who was only noticed."""


def figures() -> Iterator[Figure]:
    """Yields kiosk.noticed_ms: the median time from sending the first body to the image with the turned
    character.
    """
    kiosk = StagedKiosk(("chair", "chair"), name="bench-kiosk")
    profile = KioskProfile(characters={"chair": KioskCharacter("chair", "chair")})
    link = KioskLink(profile, Path(), [EdgeClient([kiosk.endpoint])])
    show = KioskShow(profile, Path(), link)
    ctx = create_offscreen_context()
    painter = Painter(ctx, SIZE, profile)
    clock = [time.monotonic()]

    def draw() -> None:
        now = time.monotonic()
        elapsed, clock[0] = now - clock[0], now
        frame = show.advance(elapsed)
        painter.draw(show, frame, elapsed)
        ctx.finish()

    x, z = profile.zone.center
    taken = []
    for visit in range(VISITS):
        end = time.monotonic() + EMPTY_S
        while time.monotonic() < end or (0, "chair") not in show._figures:
            kiosk.step()
            draw()
        figure, side = show._figures[0, "chair"], 1 if visit % 2 else -1
        kiosk.sensor.visitors.append(SyntheticVisitor(visit + 1, (x + 1.2 * side, z)))
        began = time.monotonic()
        while side * figure.standing.yaw < TURNED and time.monotonic() - began < 10.0:
            kiosk.step()
            draw()
        taken.append(1e3 * (time.monotonic() - began))
        kiosk.sensor.visitors.clear()
    show.close()
    kiosk.close()
    yield Figure("kiosk.noticed_ms", statistics.median(taken), "ms")
