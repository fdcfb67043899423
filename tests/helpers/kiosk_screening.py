"""A kiosk's show and its edge, in simulated time."""

from __future__ import annotations

from pathlib import Path

from kiosk_visitors import RATE_HZ, StagedKiosk

from enliven.kiosk.profile import KioskProfile
from enliven_viewer.kiosk.show import KioskShow
from enliven_viewer.kiosk.stage_link import KioskLink
from enliven_viewer.link.edge_client import EdgeClient


class Screening:
    """A show and its edge, advanced in lock-step.

    Attributes:
        frame: the last rendered frame.
    """

    def __init__(self, profile: KioskProfile, kiosk: StagedKiosk) -> None:
        self.kiosk, self.profile = kiosk, profile
        clients = [EdgeClient([kiosk.endpoint])]
        self.link = KioskLink(profile, Path(), clients, clock=lambda: kiosk.now)
        self.show = KioskShow(profile, Path(), self.link)
        self.frame = self.show.advance(0.0)

    def step(self, *presses) -> None:
        self.kiosk.step()
        self.frame = self.show.advance(1 / RATE_HZ, presses)

    def run_until(self, condition, seconds: float = 30.0) -> float:
        """Advances until a condition is true and returns the elapsed simulated seconds. Fails after
        ``seconds``.
        """
        begin = self.kiosk.now
        while not condition(self.frame):
            assert self.kiosk.now - begin < seconds, self.frame.story
            self.step()
        return self.kiosk.now - begin

    def close(self) -> None:
        self.show.close()
        self.kiosk.close()
