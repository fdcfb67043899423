"""Whoever chooses from a rigged character: their limbs, the ranking of this frame, and what is meant."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.matching import Match, Matcher, MatchRow, Pick, Picker, Ranking, ScreenView
from enliven.person import Body
from enliven_edge.stage.rig.limbs import BodySource, body_source
from enliven_edge.stage.rig.live_shape import Pair
from enliven_edge.stage.rig.settings import MatchingSettings

_TOWARDS = ScreenView(np.array([0.0, 0.0, -1.0]))
_MIRRORED = ScreenView(np.array([0.0, 0.0, 1.0]))
_NOTHING = Pick(None, -1)


class Chooser:
    """One performer at a time; somebody else, or other parts, begin anew.

    Attributes:
        body: the performer's id, -1 for nobody.
        view: from where the character is seen.
        pick: what is meant now.
    """

    def __init__(self, skeleton: Skeleton, settings: MatchingSettings) -> None:
        self._skeleton, self._settings = skeleton, settings
        self._matcher = Matcher(skeleton, settings=settings.ranking)
        self._picker = Picker(settings.picking)
        self.body, self.view, self.pick = -1, _TOWARDS, _NOTHING
        self._parts = ""
        self._source: BodySource | None = None
        self._ranking: Ranking | None = None

    @property
    def total(self) -> int:
        """How many matches there are."""
        return 0 if self._ranking is None else self._ranking.total

    def look(self, body: Body | None, parts: str, joints: Float, seconds: float) -> None:
        """Ranks every match of a body, and picks; nobody's where there is none.

        Args:
            joints: (N, 3) metres, the character's as they are shown.
            seconds: of the sensor's clock.
        """
        if body is None:
            self.forget()
            return
        if self._source is None or (self.body, self._parts) != (body.id, parts):
            self.body, self._parts, self._source = body.id, parts, body_source(body, parts)
            self._picker.reset()
        points = self._source.source.points(body.joints)
        source_view = _MIRRORED if self._settings.mirror else _TOWARDS
        self._ranking = self._matcher.rank(points, self.view, source_view, joints)
        self.pick = self._picker.update(self._ranking, points, seconds)

    def browse(self, step: int) -> None:
        """Means another match; step 0 follows the pose again."""
        if step == 0:
            self._picker.reset()
        else:
            self.pick = self._picker.cycle(step)

    def forget(self) -> None:
        """Nobody chooses."""
        self._picker.reset()
        self.body, self._source, self._ranking, self.pick = -1, None, None, _NOTHING

    def again(self) -> None:
        """Whoever chooses begins anew, and must move before holding still counts."""
        self._picker.reset()

    def accept(self) -> list[Pair]:
        """The chains of the body, and those of the character that they are to drive; none without a match."""
        match = self._picker.accept()
        if match is None or self._source is None:
            return []
        return [
            (tuple(int(joint) for joint in chain), target)
            for chain, target in zip(self._source.chains, self._chains(match), strict=True)
            if target
        ]

    def targets(self) -> list[tuple[int, ...]]:
        """The chains that are meant."""
        return [] if self.pick.match is None else [chain for chain in self._chains(self.pick.match) if chain]

    def rows(self, joints: Float) -> tuple[tuple[MatchRow, ...], int]:
        """The best matches and the one that is meant, and which of them that is; -1 for none.

        Args:
            joints: (N, 3) metres, the character's.
        """
        if self._ranking is None or self.pick.place < 0:
            return (), -1
        places = list(range(min(self._settings.listed, len(self._ranking))))
        if self.pick.place not in places:
            places.append(self.pick.place)
        rows = tuple(self._row(self._ranking[place], place, joints) for place in places)
        return rows, places.index(self.pick.place)

    def _row(self, match: Match, place: int, joints: Float) -> MatchRow:
        lines = tuple(joints[list(chain)] for chain in self._chains(match))
        return MatchRow(self._skeleton.names[match.candidate.root], place, match.score, lines)

    def _chains(self, match: Match) -> list[tuple[int, ...]]:
        """The target chain of each branch of the source; empty for none."""
        extend = self._settings.extend
        return [() if b is None else b.extended if extend else b.chain for b in match.pairs]
