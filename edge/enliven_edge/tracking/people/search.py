"""The search for bodies in groups of pixels that may be new people, and the network's verdict on them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from enliven.arrays import Bool
from enliven_edge.tracking.estimator import shipped_estimator
from enliven_edge.tracking.fit import Fitter
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.people.follower import Follower
from enliven_edge.tracking.people.visibility import trunk_shown
from enliven_edge.tracking.segment import Candidate
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import LOOK, Budget, Steps

_RECOGNISED = 0.97
"""Probability from which the network's verdict outweighs the shape: of things found by mistake 95 % stay
below 0.43."""


def likelihood(view: FrameView, pixels: Bool) -> float:
    """Returns the probability in [0, 1], by the network, that the (h, w) pixels are one person."""
    camera, pose = view.camera.camera, view.world_from_camera
    return shipped_estimator().estimate(view.z, pixels, camera, pose, None).person_probability


def recognise(newcomers: Iterable[Candidate], view: FrameView, budget: Budget) -> None:
    """Runs the network now and then on newcomers of a doubtful shape, as far as the budget goes."""
    for newcomer in newcomers:
        if budget.left > 0.0 and newcomer.needs_recognition(view.time_ns):
            newcomer.recognised = likelihood(view, newcomer.pixels) > _RECOGNISED
            budget.left -= LOOK


TRIES = 3
"""Groups of pixels in one search while no person is followed, else one: the fits need the time."""
_CLEARLY = 0.05
"""Share of explained points by which a less likely group of pixels must beat a likelier one."""
_SHOWN = 0.6
"""Share of a guessed body's trunk that the pixels must show: people behind things mostly show it."""
_FAINT = 0.36
"""Mean confidence that the joints of a guessed body must exceed: with less, few of its joints are seen."""
_HIGH = 1.3
"""Metres above the floor from which a guessed body's hip centre is none: it is a wall, or a shelf."""
_CERTAIN = 0.8
"""Share of points explained, and of trunk shown, from which an unlikely group of pixels is a person."""
_CLEAR = 0.68
"""Mean confidence of the joints that this takes too: a false body does more harm than a late one."""
_PERSON = 0.8
"""Probability by the network from which a body is a person's: of people nearly all exceed 0.85."""
_PLAINLY = 0.9
"""Share of the points explained that makes up for a lower one, where a head is seen above shoulders."""
_ONE = 0.9
"""Probability of being one person, and share explained by one body, from which split parts are one."""
_SAME = 0.25
"""Metres between two hip centres below which both are of one person: raised arms were found as another."""
_MOSTLY = 0.5
"""Share of a group of pixels that belongs to a body just found from which the group is not searched."""
Found = tuple[Candidate, Follower, float]
"""The newcomer in which a body was found, its fit, and how well that explains the pixels (up to 1)."""


class Search:
    """Finds bodies in newcomers.

    Args:
        expecting: returns the settings for a newcomer at a time, say with the height of an awaited person.
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
        """Adds bodies to ``made``: of newcomers that are surely people, else the best of the others.

        Args:
            alone: whether no person is followed.
            most: how many may be found.
        """
        yield from self.found(view, sure[: min(most, TRIES if alone else 1)], made, alone=alone)
        if not made and most > 0 and (alone or not sure):
            made += yield from self.best_guess(view, others, alone=alone)

    def found(
        self, view: FrameView, newcomers: Sequence[Candidate], made: list[Found], *, alone: bool
    ) -> Steps[None]:
        """Adds the newcomers in which a body is found to ``made``; ``alone``: no person is followed."""
        vain: list[Bool] = []
        for newcomer in newcomers:
            body = None if _within(newcomer, made) else (yield from self._body(view, newcomer, vain))
            if body is None or not _likely(view, newcomer, *body) or _again(body[0], made):
                newcomer.failed(view.time_ns)
            elif newcomer.tall or newcomer.awaited or alone or _certain(view, newcomer, *body):
                made.append((newcomer, *body))
            else:
                newcomer.failed(view.time_ns)

    def _body(
        self, view: FrameView, newcomer: Candidate, vain: list[Bool]
    ) -> Steps[tuple[Follower, float] | None]:
        """Searches the newcomer joined with parts that were split from it, then the newcomer alone.

        Args:
            vain: (h, w) unions that were searched in vain already; those of this newcomer are added.
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
            body = yield from Follower.sought(view, union, expecting, self._fitter, entire=True)
            if body is not None and body[1] > _ONE:
                newcomer.grow(view, union)
                return body
        return (yield from Follower.sought(view, newcomer.pixels, expecting, self._fitter))

    def best_guess(self, view: FrameView, due: Sequence[Candidate], *, alone: bool) -> Steps[list[Found]]:
        """Returns the likeliest of some doubtful newcomers, or one explained clearly better; at most one."""
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


def _likely(view: FrameView, newcomer: Candidate, follower: Follower, explained: float) -> bool:
    """Whether the pixels of a found body are likely a person and no thing.

    An upright shape counts only above a known floor: by a guessed one a cupboard may be as tall as a person.
    """
    if follower.person_probability > _PERSON:
        return True
    return view.has_floor and newcomer.shape.upright and explained > _PLAINLY


def _within(newcomer: Candidate, found: list[Found]) -> bool:
    """Whether most of the newcomer belongs to a person who was just found."""
    size = max(1, int(newcomer.pixels.sum()))
    return any(int((newcomer.pixels & other.pixels).sum()) > _MOSTLY * size for other, _, _ in found)


def _again(follower: Follower, found: list[Found]) -> bool:
    """Whether a person was just found at the same place, in another piece of the same person."""
    place = follower.posture.position
    return any(float(np.linalg.norm(other.posture.position - place)) < _SAME for _, other, _ in found)


def _certain(view: FrameView, newcomer: Candidate, follower: Follower, explained: float) -> bool:
    """Whether the evidence for a body suffices to believe it in an unlikely group of pixels."""
    shown = trunk_shown(view, follower.posture, newcomer.pixels)
    return min(explained, shown) > _CERTAIN and float(follower.confidence.mean()) > _CLEAR
