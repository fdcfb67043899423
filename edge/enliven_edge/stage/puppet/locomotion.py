"""Locomotion of a puppet frame by frame: its root in the world while performers move it.

In contact the anchor does not move over the floor. The anchor is a foot that the performer stands on until
they lift it, or, where that is not known, the lowest foot until another is clearly lower. In the air the
puppet keeps the velocity with which it left the floor, and its height is the performer's lift at the puppet's
size, as the time of landing is not known yet.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import ContactSettings, LocomotionSettings
from enliven.examples import State
from enliven.examples.spacetime import stand
from enliven.mapping import turned_about_y
from enliven.person import Body, Joint
from enliven_edge.stage.puppet.leash import Leash

_SIDES = ((Joint.FOOT_LEFT, Joint.ANKLE_LEFT), (Joint.FOOT_RIGHT, Joint.ANKLE_RIGHT))
_CREEP = 0.01
"""Metres a second by which the floor's estimate may rise: slow, as a jump lasts less than a second."""
_DEAD = 0.025
"""Share of a person's height below which feet are not in the air: heels lift, and joints are inexact."""
_SURE = 0.5
"""Probability of contact from which a foot stands: more likely than not."""
_STILL_SURE = 0.3
"""Probability of contact below which a standing foot no longer stands: lower, so that it does not flicker."""
_WINDOW = 0.1
"""Seconds over which the speed of a foot is measured: three frames of a usual sensor."""
_LEG = 0.5
"""Length of a leg as a share of a person's height."""
_HIGHEST = 1.0
"""Share of a person's height to which a lift is limited: no person jumps higher."""
_ADULT = 1.7
"""Metres: the height taken for a performer of unknown height, an average adult's."""
_LOWEST = 0.3
"""Metres: a smaller height comes from missing joints and is unknown."""
LEFT_FOOT = 0
"""The side of a control point that goes with the left leg: an index into (left, right, either)."""
RIGHT_FOOT = 1
"""The side of a control point that goes with the right leg."""
EITHER = 2
"""The side of a control point that goes with neither leg: it stands where either foot does."""


@dataclass(frozen=True)
class Footing:
    """How the performer stands.

    Attributes:
        touches: whether a foot touches the floor.
        lift: height of the feet above the floor, as a share of the performer's height.
        stands: whether the left and the right foot stand; both false where that is not known.
    """

    touches: bool = True
    lift: float = 0.0
    stands: tuple[bool, bool] = (False, False)


class Feet:
    """Tells on which feet a performer stands; both feet must be seen off the floor to be in the air."""

    def __init__(self, settings: ContactSettings | None = None, runner: float = 0.4) -> None:
        self._how, self._runner = settings or ContactSettings(), runner
        self._floor = np.full((2, 2), np.inf)
        self._seconds = 0.0
        self._path: deque[tuple[float, Float]] = deque()
        self._down = [False, False]

    def see(self, body: Body, seconds: float) -> Footing:
        """Returns the footing of a body, ``seconds`` after the last one."""
        self._seconds += seconds
        joints = np.array(_SIDES)
        at = body.joints[joints]
        seen = (body.confidence[joints] > 0) & np.isfinite(at).all(2)
        heights = np.where(seen, at[..., 1], np.inf)
        self._floor = np.minimum(self._floor + _CREEP * seconds, heights)
        above = np.where(seen, heights - np.where(seen, self._floor, 0.0), np.inf).min(1)
        self._stand(body, at, seen, above)
        stands = self._down[0], self._down[1]
        if not seen.any(1).all() or self._contacts(body).any():
            return Footing(stands=stands)
        lift = min(float(above.min()) / height_of(body), _HIGHEST)
        if lift <= _DEAD:
            return Footing(stands=stands)
        return Footing(False, lift - _DEAD)

    def _stand(self, body: Body, at: Float, seen: Bool, above: Float) -> None:
        """Decides which feet stand: by the tracker's contacts, else by height and speed, as in a take."""
        if body.contacts is not None:
            self._down = self._contacts(body).tolist()
            return
        places = np.where(seen[:, :1], at[:, 0], at[:, 1])
        while self._path and self._seconds - self._path[0][0] > _WINDOW:
            self._path.popleft()
        self._path.append((self._seconds, places))
        since = max(self._seconds - self._path[0][0], 1e-9)
        velocity = (places - self._path[0][1]) / since
        speeds = np.linalg.norm(velocity, axis=1)
        leg = _LEG * height_of(body)
        # A runner's foot rolls fast while it stands: it is slow against the other.
        slow = max(self._how.speed * leg, self._runner * float(np.linalg.norm(velocity.mean(0)[[0, 2]])))
        for k in range(2):
            more = self._how.release if self._down[k] else 1.0
            low = above[k] <= self._how.height * leg * more
            self._down[k] = bool(seen[k].any() and low and speeds[k] <= slow * more)

    def _contacts(self, body: Body) -> Bool:
        """Returns (2,) whether the tracker says that the left and the right foot stand."""
        if body.contacts is None:
            return np.zeros(2, np.bool_)
        least = np.where(self._down, _STILL_SURE, _SURE)
        return np.asarray(body.contacts >= least)


def height_of(body: Body) -> float:
    """Returns the performer's height in metres; an adult's where it is unknown."""
    height = body.height
    return height if np.isfinite(height) and height > _LOWEST else _ADULT


def side_of_foot(joint: Joint) -> int:
    """Returns the side that a joint goes with: ``LEFT_FOOT``, ``RIGHT_FOOT`` or ``EITHER``."""
    if joint.name.endswith(("LEFT", "RIGHT")) and joint.name.split("_")[0] in (
        "HIP",
        "KNEE",
        "ANKLE",
        "FOOT",
    ):
        return LEFT_FOOT if joint.name.endswith("LEFT") else RIGHT_FOOT
    return EITHER


class Locomotion:
    """Moves the root of a puppet frame by frame.

    Args:
        rest: (P, 3) metres, the control points at rest.
        feet: numbers of the control points that it can stand on; without any it stays on its spot.
        step: seconds between frames.
        sides: (F,) the performer's foot for each, see :func:`side_of_foot`; None: either foot for all.
    """

    def __init__(
        self,
        rest: Float,
        feet: Sequence[int],
        step: float,
        settings: LocomotionSettings,
        sides: Sequence[int] | None = None,
    ) -> None:
        self._feet: Int = np.asarray(feet, np.int64)
        self._sides: Int = np.asarray([EITHER] * len(feet) if sides is None else sides, np.int64)
        self._step = step
        self._sole = float(rest[self._feet, 1].min()) if len(self._feet) else 0.0
        large = float(np.linalg.norm(np.ptp(rest, axis=0))) or 1.0
        self._grip = settings.grip * large
        self._leash = Leash(large, settings.leash * large, step)
        self._roots: deque[Float] = deque(maxlen=max(round(settings.throw / step), 1) + 1)
        self._velocity = np.zeros(3)
        self._before: Float | None = None
        self.anchor = -1
        self.root = np.zeros(3)

    def begin(self, root: Float) -> None:
        """Starts anew at a root (3,), metres."""
        self.root = np.array(root, np.float64)
        self._before, self.anchor = None, -1
        self._roots.clear()
        self._leash.begin()

    def stands(self, state: State) -> Float:
        """Returns (3,) metres, the middle of the feet, before the puppet's own place and rotation."""
        feet = turned_about_y(state.places[self._feet], np.asarray(state.yaw))
        return np.asarray(feet.mean(0) + state.root)

    def shift(self, by: Float) -> None:
        """Moves the root, the past ones included, by (3,) metres."""
        self.root = self.root + by
        self._roots = deque((root + by for root in self._roots), self._roots.maxlen)
        self._leash.shift(by)

    @property
    def goes(self) -> bool:
        """Whether the puppet has feet to walk on."""
        return len(self._feet) > 0

    def go(self, places: Float, yaw: float, footing: Footing, size: float, way: Float | None = None) -> Float:
        """Returns the root (3,) of the next frame, metres.

        Args:
            places: (P, 3) metres in the puppet's frame.
            yaw: radians.
            size: metres that the puppet rises for a lift of 1.
            way: (2,) beside and ahead, the performer's hips in their own heights, in the puppet's axes; None:
                where its steps lead it is right.
        """
        if len(self._feet) == 0:
            return self.root
        turned = turned_about_y(places, np.asarray(yaw))
        root = self.root.copy()
        if footing.touches:
            self._stand(turned, root, footing.stands)
        else:
            self._fly(root)
        if way is not None:
            root += self._leash.pull(root, way)
        root[1] = self._sole - turned[self._feet, 1].min() + footing.lift * size
        self._before, self.root = turned, root
        return root

    def _stand(self, turned: Float, root: Float, stands: tuple[bool, bool]) -> None:
        """Moves the root in contact, as in a take; the first anchor is the lowest foot."""
        known = np.array([*stands, any(stands)])[self._sides]
        before = turned if self._before is None else self._before
        roots, anchors = np.stack([root, root]), np.array([self.anchor, -1])
        stand(
            np.stack([before, turned]), self._feet, np.stack([known, known]), self._grip, 1, 1, roots, anchors
        )
        self.anchor = int(anchors[1])
        root[:] = roots[1]
        self._roots.append(root.copy())

    def _fly(self, root: Float) -> None:
        if self.anchor >= 0:
            frames = len(self._roots) - 1
            self._velocity = (self._roots[-1] - self._roots[0]) / max(frames * self._step, 1e-9)
            self.anchor = -1
            self._roots.clear()
        root += self._velocity * self._step
