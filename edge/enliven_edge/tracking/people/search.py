"""Looking for bodies in groups of pixels that may be somebody new."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from enliven.arrays import Bool
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.people.person import trunk_shown
from enliven_edge.tracking.people.recognition import likelihood
from enliven_edge.tracking.segment import Candidate
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import LOOK, Steps

TRIES = 3
"""Groups of pixels that are looked at in a frame while nobody is followed; else one."""
_CLEARLY = 0.05
"""How much better a less likely group of pixels must be explained to be taken for a person."""
_SHOWN, _FAINT = 0.6, 0.36
"""Share of the trunk that must be seen where one is found, and how sure the joints must be at the least."""
_HIGH = 1.3
"""Metres above the floor that nobody's hip centre is by a guess: it is a wall, or a shelf."""
_CERTAIN, _CLEAR = 0.8, 0.68
"""How well somebody in an unlikely posture must be explained, and how sure the joints, among others."""

_SOMEBODY, _PLAINLY = 0.8, 0.9
"""How likely the network must find it to be a person; or how well it must be explained where it has a head
above shoulders."""

_ONE = 0.9
"""How likely several parts must be one person together, and how well one body must explain them."""
_SAME = 0.25
"""Metres between the hip centres of two people in whom one is seen."""

Found = tuple[Candidate, Follower, float]
"""In whom a body was found, its fit, and how well that explains the pixels (up to 1)."""


class Search:
    """Finds bodies in newcomers.

    Args:
        expecting: the settings for a newcomer at a time: those of somebody who is awaited, say.
    """

    def __init__(self, fitter: Fitter, expecting: Callable[[Candidate, int], TrackerSettings]) -> None:
        self._fitter, self._expecting = fitter, expecting

    def looked(
        self,
        view: FrameView,
        sure: Sequence[Candidate],
        others: Sequence[Candidate],
        made: list[Found],
        *,
        alone: bool,
        most: int,
    ) -> Steps[None]:
        """Adds bodies to ``made``: those of newcomers that are surely people, else the best of the others.

        Args:
            most: how many may be found.
        """
        yield from self.found(view, sure[: min(most, TRIES if alone else 1)], made, alone=alone)
        if not made and most > 0 and (alone or not sure):
            made += yield from self.best_guess(view, others, alone=alone)

    def found(
        self, view: FrameView, newcomers: Sequence[Candidate], made: list[Found], *, alone: bool
    ) -> Steps[None]:
        """Adds those of the newcomers in whom a body is found to ``made``; ``alone``: nobody is followed."""
        vain: list[Bool] = []
        for newcomer in newcomers:
            body = None if _within(newcomer, made) else (yield from self._body(view, newcomer, vain))
            if body is None or not _likely(newcomer, *body) or _again(body[0], made):
                newcomer.failed(view.time_ns)
            elif newcomer.tall or newcomer.awaited or alone or _certain(view, newcomer, *body):
                made.append((newcomer, *body))
            else:
                newcomer.failed(view.time_ns)

    def _body(
        self, view: FrameView, newcomer: Candidate, vain: list[Bool]
    ) -> Steps[tuple[Follower, float] | None]:
        """The body in a newcomer; where one explains more of what it was parted from, in all of that.

        Args:
            vain: (h, w) unions that were looked at for others in vain; those of this newcomer are added.
        """
        expecting = self._expecting(newcomer, view.time_ns)
        for union in newcomer.unions if expecting.estimator else []:
            if any(np.array_equal(union, other) for other in vain):
                continue
            vain.append(union)
            likely = likelihood(view, union)
            yield LOOK
            if likely < _ONE:
                continue
            body = yield from Follower.sought(view, union, expecting, self._fitter)
            if body is not None and body[1] > _ONE:
                newcomer.grow(view, union)
                return body
        return (yield from Follower.sought(view, newcomer.pixels, expecting, self._fitter))

    def best_guess(self, view: FrameView, due: Sequence[Candidate], *, alone: bool) -> Steps[list[Found]]:
        """In any posture somebody is better than nobody: the likeliest, or one explained clearly better."""
        best: list[Found] = []
        found: list[Found] = []
        yield from self.found(view, due[: TRIES if alone else 1], found, alone=alone)
        for made in found:
            shown = trunk_shown(view, made[1].posture, made[0].pixels)
            borne_out = shown > _SHOWN and float(made[1].confidence.mean()) > _FAINT
            borne_out = borne_out and float(made[1].posture.position[1]) < _HIGH
            if not borne_out or not (alone or made[0].awaited or _certain(view, *made)):
                made[0].failed(view.time_ns)
            elif not best or made[2] > best[0][2] + _CLEARLY:
                best = [made]
        return best


def _likely(newcomer: Candidate, follower: Follower, explained: float) -> bool:
    """Whether what a body was found in is likely to be a person and no thing."""
    return follower.somebody > _SOMEBODY or (newcomer.shape.upright and explained > _PLAINLY)


def _within(newcomer: Candidate, found: list[Found]) -> bool:
    """Whether most of it turned out to be of somebody who was just found."""
    size = max(1, int(newcomer.pixels.sum()))
    return any(int((newcomer.pixels & other.pixels).sum()) > 0.5 * size for other, _, _ in found)


def _again(follower: Follower, found: list[Found]) -> bool:
    """Whether somebody was just found there: in another piece of them."""
    place = follower.posture.position
    return any(float(np.linalg.norm(other.posture.position - place)) < _SAME for _, other, _ in found)


def _certain(view: FrameView, newcomer: Candidate, follower: Follower, explained: float) -> bool:
    """Whether a body is so well borne out that it is believed in an unlikely group of pixels."""
    shown = trunk_shown(view, follower.posture, newcomer.pixels)
    return min(explained, shown) > _CERTAIN and float(follower.confidence.mean()) > _CLEAR
