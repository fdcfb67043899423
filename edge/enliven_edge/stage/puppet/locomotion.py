"""Locomotion of a puppet frame by frame: its root in the world while performers move it.

A puppet steps with the feet that alternate in its key poses. During contact the anchor foot does not slide on
the floor (foot lock). The anchor is a foot that supports the performer, until the performer lifts it. If
contacts are unknown, the anchor is the lowest foot until another is clearly lower. In the air the puppet
keeps its take-off velocity. Its height is then the performer's lift, scaled to the puppet's size, because the
time of landing is not known yet. Every puppet stays near its performer's path, which is scaled to the
puppet's strides. Takes use the same rules.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import ContactSettings, LocomotionSettings
from enliven.examples.puppet_motion import PuppetState
from enliven.examples.spacetime.anchoring import choose_anchors
from enliven.examples.spacetime.following import PathFollower, complex_from_floor, floor_from_complex
from enliven.examples.travel import PuppetTravel
from enliven.person import Body, Joint
from enliven.skeletons.facing import rotate_about_y

_SIDES = ((Joint.FOOT_LEFT, Joint.ANKLE_LEFT), (Joint.FOOT_RIGHT, Joint.ANKLE_RIGHT))
_LEGS = (
    (Joint.HIP_LEFT, Joint.KNEE_LEFT, Joint.ANKLE_LEFT),
    (Joint.HIP_RIGHT, Joint.KNEE_RIGHT, Joint.ANKLE_RIGHT),
)
_FLOOR_RISE_RATE = 0.01
"""Maximum rise of the floor estimate in metres per second. It is slow, because a jump lasts less than a
second."""
_MIN_LIFT = 0.025
"""Minimum lift of a foot that is in the air, as a fraction of body height. The heels of a standing person
rise less, and joints are noisy."""
_CONTACT_PROBABILITY = 0.5
"""Minimum contact probability at which a foot starts to stand. Contact is then likelier than not."""
_RELEASE_PROBABILITY = 0.3
"""A standing foot is released below this contact probability. It is lower than the probability at which a
foot starts to stand (hysteresis), so that contacts do not flicker.
"""
_SPEED_WINDOW_S = 0.1
"""Seconds over which the speed of a foot is measured: three frames of a usual sensor."""
_LEG_RATIO = 0.5
"""Length of a leg as a fraction of body height."""
_MAX_LIFT = 1.0
"""Maximum lift as a fraction of body height. People do not jump higher."""
_DEFAULT_HEIGHT_M = 1.7
"""Assumed height in metres of a performer of unknown height: that of an average adult."""
_MIN_HEIGHT_M = 0.3
"""Minimum plausible height of a performer in metres. A smaller height comes from missing joints, and counts
as unknown."""
LEFT_FOOT = 0
"""Side of a control point that stands with the left leg. It is an index into (left, right, either)."""
RIGHT_FOOT = 1
"""Side of a control point that stands with the right leg. See ``LEFT_FOOT``."""
EITHER_FOOT = 2
"""Side of a control point that belongs to neither leg. It stands if the left or the right foot stands. See
``LEFT_FOOT``."""


@dataclass(frozen=True)
class Footing:
    """Foot contacts and jump height of a performer.

    Attributes:
        touches: True if a foot touches the floor.
        lift: height of the feet above the floor, as a fraction of body height.
        stands: whether the left and the right foot stand. Both are False if this is unknown.
    """

    touches: bool = True
    lift: float = 0.0
    stands: tuple[bool, bool] = (False, False)


class FootDetector:
    """Detects the feet that stand on the floor. A jump needs both feet visible and off the floor."""

    def __init__(self, settings: ContactSettings | None = None, runner: float = 0.4) -> None:
        self._how, self._runner = settings or ContactSettings(), runner
        self._floor = np.full((2, 2), np.inf)
        self._seconds = 0.0
        self._path: deque[tuple[float, Float]] = deque()
        self._down = [False, False]

    def update(self, body: Body, seconds: float) -> Footing:
        """Returns the footing of a body, ``seconds`` after the last one."""
        self._seconds += seconds
        joints = np.array(_SIDES)
        places = body.joints[joints]
        seen = (body.confidence[joints] > 0) & np.isfinite(places).all(2)
        heights = np.where(seen, places[..., 1], np.inf)
        self._floor = np.minimum(self._floor + _FLOOR_RISE_RATE * seconds, heights)
        above = np.where(seen, heights - np.where(seen, self._floor, 0.0), np.inf).min(1)
        self._decide_standing(body, places, seen, above)
        stands = self._down[0], self._down[1]
        if not seen.any(1).all() or self._read_contacts(body).any():
            return Footing(stands=stands)
        lift = min(float(above.min()) / performer_height(body), _MAX_LIFT)
        if lift <= _MIN_LIFT:
            return Footing(stands=stands)
        return Footing(False, lift - _MIN_LIFT)

    def _decide_standing(self, body: Body, at: Float, seen: Bool, above: Float) -> None:
        """Decides which feet stand: by the tracker's contacts, or else by height and speed, in the same way
        as in a take.
        """
        if body.contacts is not None:
            self._down = self._read_contacts(body).tolist()
            return
        places = np.where(seen[:, :1], at[:, 0], at[:, 1])
        while self._path and self._seconds - self._path[0][0] > _SPEED_WINDOW_S:
            self._path.popleft()
        self._path.append((self._seconds, places))
        elapsed_s = max(self._seconds - self._path[0][0], 1e-9)
        velocity = (places - self._path[0][1]) / elapsed_s
        speeds = np.linalg.norm(velocity, axis=1)
        leg = _LEG_RATIO * performer_height(body)
        # A runner's standing foot rolls fast, but it is slow relative to the mean of both feet.
        slow = max(self._how.speed * leg, self._runner * float(np.linalg.norm(velocity.mean(0)[[0, 2]])))
        for k in range(2):
            release_factor = self._how.release if self._down[k] else 1.0
            low = above[k] <= self._how.height * leg * release_factor
            self._down[k] = bool(seen[k].any() and low and speeds[k] <= slow * release_factor)

    def _read_contacts(self, body: Body) -> Bool:
        """Returns (2,) flags: True if the tracker reports contact of the left and the right foot."""
        if body.contacts is None:
            return np.zeros(2, np.bool_)
        min_probabilities = np.where(self._down, _RELEASE_PROBABILITY, _CONTACT_PROBABILITY)
        return np.asarray(body.contacts >= min_probabilities)


def performer_height(body: Body) -> float:
    """Returns the performer's height in metres, or an adult's height if it is unknown."""
    height = body.height
    return height if np.isfinite(height) and height > _MIN_HEIGHT_M else _DEFAULT_HEIGHT_M


def side_of_foot(joint: Joint) -> int:
    """Returns the side that a joint belongs to: ``LEFT_FOOT``, ``RIGHT_FOOT`` or ``EITHER_FOOT``."""
    if joint.name.endswith(("LEFT", "RIGHT")) and joint.name.split("_")[0] in (
        "HIP",
        "KNEE",
        "ANKLE",
        "FOOT",
    ):
        return LEFT_FOOT if joint.name.endswith("LEFT") else RIGHT_FOOT
    return EITHER_FOOT


def leg_length(body: Body) -> float:
    """Returns the length of thigh plus shank in metres, the mean of the visible legs.

    If no leg is visible, the result is an estimate.
    """
    joints = np.array(_LEGS)
    seen = ((body.confidence[joints] > 0) & np.isfinite(body.joints[joints]).all(2)).all(1)
    if not seen.any():
        return _LEG_RATIO * performer_height(body)
    bones = np.linalg.norm(np.diff(body.joints[joints[seen]], axis=1), axis=2)
    return max(float(bones.sum(1).mean()), _LEG_RATIO * _MIN_HEIGHT_M)


class Locomotion:
    """Moves the root of a puppet frame by frame.

    Args:
        rest: (P, 3) metres, the control points at rest.
        feet: indices of the control points that the puppet can stand on.
        step: seconds between frames.
        sides: (F,) the performer's foot for each of ``feet``, see :func:`side_of_foot`. If None, either foot
            is used for all.
        travel: the feet with which the puppet steps, and its stride. If None, the puppet stays at its
            position.
    """

    def __init__(
        self,
        rest: Float,
        feet: Sequence[int],
        step: float,
        settings: LocomotionSettings,
        sides: Sequence[int] | None = None,
        travel: PuppetTravel | None = None,
    ) -> None:
        self._feet: Int = np.asarray(feet, np.int64)
        self._sides: Int = np.asarray([EITHER_FOOT] * len(feet) if sides is None else sides, np.int64)
        self._steps = np.isin(self._feet, travel.feet) if travel else np.zeros(len(feet), np.bool_)
        self._step = step
        self._sole = float(rest[self._feet, 1].min()) if len(self._feet) else 0.0
        large = float(np.linalg.norm(np.ptp(rest, axis=0))) or 1.0
        self._grip = settings.grip * large
        self._new = lambda: PathFollower(large, settings, step, len(self._feet) if self._steps.any() else 0)
        self._following, self._from = self._new(), (0j, 0j)
        self._roots: deque[Float] = deque(maxlen=max(round(settings.throw / step), 1) + 1)
        self._velocity = np.zeros(3)
        self._before: Float | None = None
        self.can_step = travel is not None
        self.anchor = -1
        self.root = np.zeros(3)

    def begin(self, root: Float, path_position: complex) -> None:
        """Starts again at a root (3,) in metres, for a performer at ``path_position``."""
        self.root = np.array(root, np.float64)
        self._before, self.anchor = None, -1
        self._roots.clear()
        self._following, self._from = self._new(), (path_position, complex(complex_from_floor(self.root)))

    def compute_feet_centre(self, state: PuppetState) -> Float:
        """Returns the centre (3,) of the feet in metres, rotated by the yaw and moved to the root.

        The puppet's own placement is not applied.
        """
        if len(self._feet) == 0:
            return state.root
        feet = rotate_about_y(state.places[self._feet], np.asarray(state.yaw))
        return np.asarray(feet.mean(0) + state.root)

    def shift(self, by: Float) -> None:
        """Moves the root, including past roots, by (3,) metres."""
        self.root = self.root + by
        self._roots = deque((root + by for root in self._roots), self._roots.maxlen)
        self._from = self._from[0], self._from[1] + complex(complex_from_floor(by))

    def step(
        self, places: Float, yaw: float, footing: Footing, lift_scale_m: float, path_position: complex
    ) -> tuple[Float, Float]:
        """Returns the places (P, 3) and the root (3,) of the next frame, metres.

        Args:
            places: (P, 3) metres, control points in the puppet's frame.
            yaw: radians.
            lift_scale_m: rise of the puppet in metres for a lift of 1.
            path_position: the performer's path on the floor as x + iz, scaled to the puppet's strides and
                rotated to its axes.
        """
        if not self.can_step:
            return places, self.root
        turned = rotate_about_y(places, np.asarray(yaw))
        root = self.root.copy()
        if not self._steps.any():
            self._move_without_steps(turned, root)
        elif footing.touches:
            self._move_in_contact(turned, root, footing.stands)
        else:
            self._move_in_air(root)
        places = self._follow_path(places, yaw, root, path_position, footing)
        if len(self._feet):
            root[1] = self._sole - turned[self._feet, 1].min() + footing.lift * lift_scale_m
        self._before, self.root = turned, root
        return places, root

    def _follow_path(
        self, places: Float, yaw: float, root: Float, path_position: complex, footing: Footing
    ) -> Float:
        """Pulls the root towards the path. Returns the places (P, 3), with standing feet locked."""
        is_standing = (
            self._find_known_standing(footing.stands) | (self._feet == self.anchor)
        ) & footing.touches
        is_standing = is_standing[: len(self._following.held)]
        deviation = path_position - self._from[0] - (complex(complex_from_floor(root)) - self._from[1])
        moved = complex(complex_from_floor(root - self.root))
        pull = self._following.compute_correction(deviation, is_standing.tolist(), moved)
        root += floor_from_complex(pull)
        if not self._following.held:
            return places
        out = places.copy()
        out[self._feet] += rotate_about_y(
            floor_from_complex(np.array(self._following.held)), np.asarray(-yaw)
        )
        return out

    def _move_without_steps(self, turned: Float, root: Float) -> None:
        """Moves the root of a puppet that does not step, so that the centre of its feet stays fixed."""
        if len(self._feet) and self._before is not None:
            went = turned[self._feet].mean(0) - self._before[self._feet].mean(0)
            root -= went * [1.0, 0.0, 1.0]

    def _move_in_contact(self, turned: Float, root: Float, stands: tuple[bool, bool]) -> None:
        """Moves the root during contact, as in a take. The first anchor is the lowest foot."""
        contacts = self._find_known_standing(stands)
        old_points = turned if self._before is None else self._before
        roots, anchors = np.stack([root, root]), np.array([self.anchor, -1])
        choose_anchors(
            np.stack([old_points, turned]),
            self._feet,
            np.stack([contacts, contacts]),
            self._grip,
            1,
            1,
            roots,
            anchors,
        )
        self.anchor = int(anchors[1])
        root[:] = roots[1]
        self._roots.append(root.copy())

    def _find_known_standing(self, stands: tuple[bool, bool]) -> Bool:
        """Returns (F,) flags: True for an alternating foot if the performer's matching foot stands."""
        return np.asarray(np.array([*stands, any(stands)])[self._sides] & self._steps)

    def _move_in_air(self, root: Float) -> None:
        if self.anchor >= 0:
            frames = len(self._roots) - 1
            self._velocity = (self._roots[-1] - self._roots[0]) / max(frames * self._step, 1e-9)
            self.anchor = -1
            self._roots.clear()
        root += self._velocity * self._step
