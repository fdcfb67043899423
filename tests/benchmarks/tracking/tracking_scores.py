"""Scores of tracked bodies against the ground truth: matching, accuracy, swaps, jitter, calibration.

All functions here take arrays and return numbers. :mod:`tracking_evaluation` runs the tracker.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment
from tracking_cache import Moment

from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.person.limbs import Limb
from enliven.rotation import swing, to_matrix

NEAR = 0.10
"""A joint within this distance counts as found, metres."""
GATE = 0.5
"""Maximum mean joint distance between a person and the body matched to it, metres."""
GRACE = 0.5
"""Time after entering in which a person need not be tracked, seconds."""
SEEN_ENOUGH = 6
"""Minimum number of visible joints for a person to be in view."""
RECOVERED = 0.15
"""A lost person counts as recovered if the mean distance of the visible joints is below this, metres."""
_STAYS = 3
"""Minimum duration, in frames, of a recovery, a swap or a false body."""
_HIGH_PASS = 0.5
"""Window of the moving average that is subtracted before jitter is measured, seconds."""
_SUMS = (
    "error", "matched", "missed", "early_hits", "early_visible", "identity", "mirrored", "false", "seconds",
)  # fmt: skip
"""Attributes of the scores that are summed."""
_ARMS = ((5, 6, 7), (9, 10, 11))
_LEGS = ((13, 14, 15), (17, 18, 19))
BINS = 10
TURNS: dict[str, tuple[tuple[Joint, Limb], ...]] = {
    "chest": ((Joint.SHOULDER_CENTER, Limb.CHEST),),
    "head": ((Joint.HEAD, Limb.SKULL),),
    "forearm": ((Joint.WRIST_LEFT, Limb.FOREARM_LEFT), (Joint.WRIST_RIGHT, Limb.FOREARM_RIGHT)),
    "hand": ((Joint.HAND_LEFT, Limb.HAND_LEFT), (Joint.HAND_RIGHT, Limb.HAND_RIGHT)),
}
"""Parts with a measured rotation error: chest and head by their facing, forearms and hands about their
length."""


@dataclass
class Take:
    """The tracker's result on one sequence, with the ground truth.

    Attributes:
        times: (F,) seconds.
        moments: the truth of each frame.
        bodies: the tracker's bodies.
        observed: (F,) True if the frame was new: not covered, frozen, or late.
        cost: (F,) time per frame, seconds.
    """

    times: np.ndarray
    moments: Sequence[Moment]
    bodies: list[list[Body]]
    observed: np.ndarray
    cost: np.ndarray


@dataclass
class Scores:
    """The scores of one sequence, stored as sums so that sequences can be added.

    Attributes:
        hits, visible: (20,) number of visible joints found within 10 cm, and of all visible joints.
        error: sum of the errors of matched visible joints, metres; ``matched`` is their number.
        missed: visible joints of people who were not tracked.
        early_hits, early_visible: the same for the first half second of people in view in the first
            frame. They count in no other score.
        sure, sure_hits: (10,) number of joints by confidence, in tenths, and of those within 10 cm.
        identity, mirrored, false: number of identity changes, left-right swaps, and bodies without a
            person.
        seconds: length of the sequence. jitter: jitter of each joint that stood still, mm. recovery: time
            after each forced loss in ms, inf if never.
        turned: rotation errors of the visible parts of :data:`TURNS`, degrees.
        standing: for each visible foot, True if its floor contact was reported correctly.
        told: for each fault of the input, True if it was reported.
        per_frame: (F,) fraction found in each frame; NaN if no joints count.
    """

    hits: np.ndarray = field(default_factory=lambda: np.zeros(20))
    visible: np.ndarray = field(default_factory=lambda: np.zeros(20))
    error: float = 0.0
    matched: int = 0
    missed: int = 0
    early_hits: int = 0
    early_visible: int = 0
    sure: np.ndarray = field(default_factory=lambda: np.zeros(BINS))
    sure_hits: np.ndarray = field(default_factory=lambda: np.zeros(BINS))
    identity: int = 0
    mirrored: int = 0
    false: int = 0
    seconds: float = 0.0
    jitter: list[float] = field(default_factory=list)
    recovery: list[float] = field(default_factory=list)
    turned: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in TURNS})
    standing: list[bool] = field(default_factory=list)
    told: list[bool] = field(default_factory=list)
    cost: list[float] = field(default_factory=list)
    per_frame: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def within(self) -> float:
        return float(self.hits.sum() / max(self.visible.sum(), 1))

    @property
    def within_from_first(self) -> float:
        """Returns the fraction of visible joints found within 10 cm, from the first frame on."""
        visible = self.visible.sum() + self.early_visible
        return float((self.hits.sum() + self.early_hits) / max(visible, 1))

    @property
    def mean_mm(self) -> float:
        return 1e3 * self.error / max(self.matched, 1)

    @property
    def minutes(self) -> float:
        return max(self.seconds, 1e-9) / 60.0

    def trusted(self, least: float) -> float:
        """Returns the fraction within 10 cm of the joints with at least this confidence, NaN if there are
        none.
        """
        first = round(least * BINS)
        total = self.sure[first:].sum()
        return float(self.sure_hits[first:].sum() / total) if total else float("nan")

    def add(self, other: Scores) -> None:
        """Adds another sequence's scores."""
        for name in ("hits", "visible", "sure", "sure_hits"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in _SUMS:
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("jitter", "recovery", "cost", "standing", "told"):
            getattr(self, name).extend(getattr(other, name))
        for name, degrees in other.turned.items():
            self.turned[name].extend(degrees)


def score(take: Take, *, still: bool = False, covered: tuple[float, float] | None = None) -> Scores:
    """Returns the scores of one take.

    Args:
        still: True if all people stand still. Jitter is then measured.
        covered: (from, to) in which the lens was covered, seconds. The recovery is then measured, and all
            other scores only after it.
    """
    count = len(take.moments[0].present)
    pairs = [match(bodies, moment) for bodies, moment in zip(take.bodies, take.moments, strict=True)]
    due, early = _due(take)
    if covered is not None:
        due &= (take.times >= covered[1] + GRACE)[:, None]
    out = Scores(seconds=float(np.ptp(take.times)), cost=list(take.cost))
    out.per_frame = np.full(len(take.times), np.nan)
    for f, (pair, moment) in enumerate(zip(pairs, take.moments, strict=True)):
        if take.observed[f]:
            _add_frame(out, f, take.bodies[f], moment, pair, due[f])
            if covered is None:
                _add_early(out, take.bodies[f], moment, pair, early[f])
    out.identity = sum(_identity_changes(take, pairs, p) for p in range(count))
    out.mirrored = sum(_mirrorings(take, pairs, p) for p in range(count))
    out.false = _false_bodies(take, pairs)
    if still:
        out.jitter = [j for p in range(count) for j in _jitter(take, pairs, p)]
    if covered is not None:
        out.recovery = [_recovery(take, pairs, p, covered[1]) for p in range(count)]
    return out


def match(bodies: list[Body], moment: Moment) -> dict[int, int]:
    """Returns the index of the body matched to each person in the room, by the mean distance of visible
    joints.
    """
    people = [p for p in np.flatnonzero(moment.present) if moment.visible[p].sum() >= 3]
    if not people or not bodies:
        return {}
    cost = np.array(
        [
            [np.linalg.norm(b.joints - moment.joints[p], axis=1)[moment.visible[p]].mean() for b in bodies]
            for p in people
        ]
    )
    rows, columns = linear_sum_assignment(np.minimum(cost, 10 * GATE))
    return {int(people[r]): int(c) for r, c in zip(rows, columns, strict=True) if cost[r, c] < GATE}


def _due(take: Take) -> tuple[np.ndarray, np.ndarray]:
    """Returns two (F, P) arrays: people that must be tracked, and people in the grace time at the start.

    A person must be tracked after being in view for longer than the grace time. The second array is True for
    people in view in the first frame.
    """
    seen = np.array([m.present & (m.visible.sum(1) >= SEEN_ENOUGH) for m in take.moments])
    due = np.zeros_like(seen)
    for p in range(seen.shape[1]):
        since, unseen = np.inf, np.inf
        for f, time in enumerate(take.times):
            if not seen[f, p]:
                if np.isfinite(since) and time - unseen > GRACE:
                    since = np.inf
                continue
            since = min(since, time)
            unseen = time
            due[f, p] = time - since >= GRACE
    early = seen & ~due & seen[0] & (take.times - take.times[0] < GRACE)[:, None]
    return due, early


def _add_frame(
    out: Scores, f: int, bodies: list[Body], moment: Moment, pair: dict[int, int], due: np.ndarray
) -> None:
    """Adds one frame's joints and their confidences."""
    hits = total = 0
    for p in np.flatnonzero(due):
        visible = moment.visible[p]
        total += int(visible.sum())
        out.visible += visible
        if p not in pair:
            out.missed += int(visible.sum())
            continue
        distances = np.linalg.norm(bodies[pair[p]].joints - moment.joints[p], axis=1)
        near = (distances < NEAR) & visible
        out.hits += near
        hits += int(near.sum())
        out.error += float(distances[visible].sum())
        out.matched += int(visible.sum())
        _add_turns(out, bodies[pair[p]], moment, p)
        _add_contacts(out, bodies[pair[p]], moment, p)
    out.per_frame[f] = hits / total if total else np.nan
    whose = {b: p for p, b in pair.items()}
    for b, body in enumerate(bodies):
        right = np.zeros(20, bool)
        if b in whose:
            right = np.linalg.norm(body.joints - moment.joints[whose[b]], axis=1) < NEAR
        tenth = np.clip((body.confidence * BINS).astype(int), 0, BINS - 1)
        np.add.at(out.sure, tenth, 1)
        np.add.at(out.sure_hits, tenth, right)


def _add_early(
    out: Scores, bodies: list[Body], moment: Moment, pair: dict[int, int], early: np.ndarray
) -> None:
    """Adds the joints of one of the first frames, for the people selected by ``early`` (P,)."""
    for p in np.flatnonzero(early):
        visible = moment.visible[p]
        out.early_visible += int(visible.sum())
        if p in pair:
            apart = np.linalg.norm(bodies[pair[p]].joints - moment.joints[p], axis=1)
            out.early_hits += int(np.count_nonzero(apart[visible] < NEAR))


def _add_turns(out: Scores, body: Body, moment: Moment, p: int) -> None:
    """Adds the rotation errors of the body's visible parts."""
    if body.orientations is None or moment.turns is None:
        return
    turns = to_matrix(body.orientations)
    for name, parts in TURNS.items():
        for joint, limb in parts:
            if moment.visible[p, joint]:
                true = moment.turns[p, limb]
                facing = name in ("chest", "head")
                off = _apart(turns[joint], true, 2) if facing else twist_between(turns[joint], true)
                out.turned[name].append(off)


def _apart(a: np.ndarray, b: np.ndarray, axis: int) -> float:
    """Returns the angle between an axis of two frames, degrees."""
    return float(np.degrees(np.arccos(np.clip(a[:, axis] @ b[:, axis], -1.0, 1.0))))


def twist_between(a: np.ndarray, b: np.ndarray) -> float:
    """Returns the twist in degrees from frame ``a`` to ``b`` about their +Y axes, after aligning these
    axes.
    """
    brought = to_matrix(swing(a[:, 1], b[:, 1])) @ a
    return _apart(brought, b, 2)


def _add_contacts(out: Scores, body: Body, moment: Moment, p: int) -> None:
    """Adds, for each visible foot, True if its contact was reported correctly."""
    contacts = getattr(body, "contacts", None)
    if contacts is None:
        return
    for side, foot in enumerate((Joint.FOOT_LEFT, Joint.FOOT_RIGHT)):
        if moment.visible[p, foot]:
            out.standing.append(bool(contacts[side] > 0.5) == bool(moment.contacts[p, side]))


def _identity_changes(take: Take, pairs: list[dict[int, int]], p: int) -> int:
    """Returns how often a person's identity changes and keeps its new value for some frames."""
    ids = [take.bodies[f][pair[p]].id for f, pair in enumerate(pairs) if p in pair and take.observed[f]]
    return _changes(ids)


def _changes(values: list[int]) -> int:
    """Returns how often a value changes to another one that stays for some frames."""
    changes, settled = 0, None
    for n, value in enumerate(values):
        if value == settled or values[n : n + _STAYS] != [value] * min(_STAYS, len(values) - n):
            continue
        changes += settled is not None
        settled = value
    return changes


def _mirrorings(take: Take, pairs: list[dict[int, int]], p: int) -> int:
    """Returns how often the left and right arms, or legs, are swapped."""
    count = 0
    for left, right in (_ARMS, _LEGS):
        swapped = []
        for f, pair in enumerate(pairs):
            if p not in pair or not take.observed[f]:
                continue
            joints, moment = take.bodies[f][pair[p]].joints, take.moments[f]
            swapped.append(_is_swapped(joints, moment.joints[p], moment.visible[p], left, right))
        count += sum(
            all(swapped[n : n + _STAYS])
            and len(swapped[n : n + _STAYS]) == _STAYS
            and not any(swapped[max(n - 1, 0) : n])
            for n in range(len(swapped))
        )
    return count


def _is_swapped(
    found: np.ndarray, true: np.ndarray, visible: np.ndarray, left: tuple[int, ...], right: tuple[int, ...]
) -> bool:
    """Returns True if a pair of limbs fits far better with left and right exchanged."""
    own, crossed = [], []
    for a, b in zip((*left, *right), (*right, *left), strict=True):
        if visible[a]:
            own.append(np.linalg.norm(found[a] - true[a]))
            crossed.append(np.linalg.norm(found[b] - true[a]))
    if len(own) < 3:
        return False
    return bool(np.mean(own) > 0.15 and np.mean(crossed) < 0.5 * np.mean(own))


def _false_bodies(take: Take, pairs: list[dict[int, int]]) -> int:
    """Returns the number of bodies without a person, or with a person that already has one. Each counts
    once."""
    lasting: dict[int, int] = {}
    for f, pair in enumerate(pairs):
        moment, taken = take.moments[f], set(pair.values())
        free = [p for p in np.flatnonzero(moment.present) if p not in pair]
        for b, body in enumerate(take.bodies[f]):
            near = any(np.linalg.norm((body.joints[0] - moment.joints[p, 0])[[0, 2]]) < GATE for p in free)
            if b not in taken and not near and take.observed[f]:
                lasting[body.id] = lasting.get(body.id, 0) + 1
    return sum(frames >= _STAYS for frames in lasting.values())


def _jitter(take: Take, pairs: list[dict[int, int]], p: int) -> list[float]:
    """Returns, in mm, each visible joint's root mean square deviation from its moving average, after the
    first second."""
    frames = [f for f, pair in enumerate(pairs) if p in pair and take.times[f] - take.times[0] > 1.0]
    step = float(np.median(np.diff(take.times)))
    window = 2 * round(_HIGH_PASS / step / 2) + 1
    if len(frames) < 2 * window:
        return []
    error = np.array([take.bodies[f][pairs[f][p]].joints - take.moments[f].joints[p] for f in frames])
    mean = np.apply_along_axis(lambda x: np.convolve(x, np.ones(window) / window, "valid"), 0, error)
    high = error[window // 2 : len(error) - window // 2] - mean
    visible = np.array([take.moments[f].visible[p] for f in frames]).all(0)
    return list(1e3 * np.sqrt((high**2).sum(-1).mean(0))[visible])


def _recovery(take: Take, pairs: list[dict[int, int]], p: int, start: float) -> float:
    """Returns the time in ms from ``start`` until the visible joints are found for some frames, inf if
    never.
    """
    after = [f for f, time in enumerate(take.times) if time - take.times[0] >= start - 1e-6]
    good = []
    for f in after:
        moment = take.moments[f]
        ok = p in pairs[f]
        if ok:
            apart = np.linalg.norm(take.bodies[f][pairs[f][p]].joints - moment.joints[p], axis=1)
            ok = bool(apart[moment.visible[p]].mean() < RECOVERED)
        good.append(ok)
    for n in range(len(good) - _STAYS + 1):
        if all(good[n : n + _STAYS]):
            return 1e3 * float(take.times[after[n]] - take.times[after[0]])
    return float("inf")


def joint_label(joint: int) -> str:
    """Returns the joint's name in figures, such as "elbow_left"."""
    return Joint(joint).name.lower()
