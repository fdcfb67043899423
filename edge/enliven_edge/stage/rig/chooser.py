"""Lets one performer choose a part of a rigged character: ranks the matches of a pose and picks one."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Skeleton
from enliven.matching.body_limbs import BodySource, body_source, limb_number
from enliven.matching.match_list import MatchRow
from enliven.matching.matches import Match, Ranking
from enliven.matching.picking import Pick, Picker
from enliven.matching.ranking import Matcher
from enliven.matching.views import ScreenView
from enliven.person import Body
from enliven_edge.stage.rig.live_shape import Pair
from enliven_edge.stage.rig.settings import MatchingSettings

_SENSOR_VIEW = ScreenView(np.array([0.0, 0.0, -1.0]))
"""The view of a sensor in front of performers who face +Z."""
_MIRROR_VIEW = ScreenView(np.array([0.0, 0.0, 1.0]))
"""The view from behind the performers, as in a mirror."""
_NO_PICK = Pick(None, -1)
"""The pick without a match."""


class Chooser:
    """Ranks the matches of one performer at a time, and picks one of them.

    The choice restarts if the performer or the body parts change.

    Attributes:
        body: the performer's id, or -1 for none.
        view: the viewer's direction of view.
        pick: the currently picked match.
    """

    def __init__(self, skeleton: Skeleton, settings: MatchingSettings) -> None:
        self._skeleton, self._settings = skeleton, settings
        self._matcher = Matcher(skeleton, settings=settings.ranking)
        self._picker = Picker(settings.picking)
        self.body, self.view, self.pick = -1, _SENSOR_VIEW, _NO_PICK
        self._parts = ""
        self._source: BodySource | None = None
        self._ranking: Ranking | None = None

    @property
    def total(self) -> int:
        """Returns the number of matches."""
        return 0 if self._ranking is None else self._ranking.total

    def rank(self, body: Body | None, parts: str, joints: Float, seconds: float) -> None:
        """Ranks every match of a body and picks one. Forgets the performer if ``body`` is None.

        Args:
            joints: (N, 3) metres, the shown joints of the character.
            seconds: time of the sensor's clock.
        """
        if body is None:
            self.forget()
            return
        if self._source is None or (self.body, self._parts) != (body.id, parts):
            self.body, self._parts, self._source = body.id, parts, body_source(body, parts)
            self._picker.reset()
        points = self._source.source.points(body.joints)
        source_view = _MIRROR_VIEW if self._settings.mirror else _SENSOR_VIEW
        self._ranking = self._matcher.rank(points, self.view, source_view, joints)
        self.pick = self._picker.update(self._ranking, points, seconds)

    def browse(self, step: int) -> None:
        """Picks another match. With step 0, the pick follows the pose again."""
        if step == 0:
            self._picker.reset()
        else:
            self.pick = self._picker.cycle(step)

    def forget(self) -> None:
        """Forgets the performer, so that the next one restarts the choice."""
        self._picker.reset()
        self.body, self._source, self._ranking, self.pick = -1, None, None, _NO_PICK

    def restart(self) -> None:
        """Restarts the choice. The performer must move first, before holding still can accept a match."""
        self._picker.reset()

    def accept(self) -> list[Pair]:
        """Accepts the match.

        Returns pairs of a body chain and the character chain that it drives. The result is empty without a
        match.
        """
        match = self._picker.accept()
        if match is None or self._source is None:
            return []
        return [
            (tuple(int(joint) for joint in chain), target)
            for chain, target in zip(self._source.chains, self._chains_for_source(match), strict=True)
            if target
        ]

    def targets(self) -> list[tuple[int, ...]]:
        """Returns the character's chains of the picked match."""
        return (
            []
            if self.pick.match is None
            else [chain for chain in self._chains_for_source(self.pick.match) if chain]
        )

    def rows(self, joints: Float) -> tuple[tuple[MatchRow, ...], int]:
        """Returns the rows of the best matches, including the picked match, and the index of the picked
        match.

        The index is -1 without matches.

        Args:
            joints: (N, 3) metres, the joints of the character.
        """
        if self._ranking is None or self.pick.place < 0:
            return (), -1
        places = list(range(min(self._settings.listed, len(self._ranking))))
        if self.pick.place not in places:
            places.append(self.pick.place)
        rows = tuple(self._match_row(self._ranking[place], place, joints) for place in places)
        return rows, places.index(self.pick.place)

    def _match_row(self, match: Match, place: int, joints: Float) -> MatchRow:
        lines = tuple(joints[list(chain)] for chain in self._chains_for_source(match))
        limbs = () if self._source is None else tuple(limb_number(chain) for chain in self._source.chains)
        name = self._skeleton.names[match.candidate.root]
        return MatchRow(name, place, match.score, lines, limbs, self.body)

    def _chains_for_source(self, match: Match) -> list[tuple[int, ...]]:
        """Returns the character's chain for each branch of the source. The chain of an unmatched branch is
        empty.
        """
        extend = self._settings.extend
        return [() if b is None else b.extended if extend else b.chain for b in match.pairs]
