"""Computes the position of the mesh in the world: anchored during floor contact, ballistic in flight (section
5).

    switches = find_switches(performance.world[:, feet], step, size)        # edit them on the timeline
    placed = place_motion(places (F, P, 3), yaw (F,), step, switches, feet)  # placed.world, .root, .anchors

In contact the lowest foot is on the floor, and the anchor does not move over it. The anchor is the lowest
foot. It changes only when another foot is clearly lower. In flight the mesh keeps its take-off velocity. Its
vertical velocity is chosen so that it lands when the performer lands. In the free mode, the mesh keeps its
vertical take-off velocity instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import Coupling, LocomotionSettings, Switch
from enliven.errors import InputError
from enliven.examples.spacetime.anchoring import choose_anchors
from enliven.motion.contact.contacts import detect_contact_frames, find_runs
from enliven.skeletons.facing import rotate_about_y


@dataclass(frozen=True, eq=False)
class PlacedMotion:
    """The motion of a mesh's control points in the world.

    Attributes:
        world: (F, P, 3) metres, the control points; the floor is y = 0.
        root: (F, 3) metres: world = mesh rotated by yaw, plus root.
        anchors: (F,) the number of the control point that stays in place on the floor. It is -1 in flight.
        switches: the resulting switches between contact and flight.
    """

    world: Float
    root: Float
    anchors: Int
    switches: tuple[Switch, ...]

    def create_level_constraints(self, points: Sequence[str]) -> tuple[Coupling, ...]:
        """Returns constraints that give two feet equal heights when the anchor changes. Solve again with
        these constraints.
        """
        frames = np.flatnonzero((self.anchors[1:] != self.anchors[:-1]) & (self.anchors[1:] >= 0)) + 1
        pairs = [(int(self.anchors[f - 1]), int(self.anchors[f]), int(f)) for f in frames]
        return tuple(Coupling(points[b], points[a], f) for a, b, f in pairs if a >= 0)


def find_switches(
    feet: Float, step: float, size: float, settings: LocomotionSettings | None = None
) -> tuple[Switch, ...]:
    """Detects when a performer touches the floor, from the feet (F, K, 3) in the world, metres. The first
    switch is at frame 0.

    A foot touches the floor while it is low, and either slow or at its lowest point. If no foot touches the
    floor, the performer is in flight.

    Args:
        step: seconds between frames.
        size: metres, the length of the legs.
    """
    settings = settings or LocomotionSettings()
    if len(feet) < 3:
        return (Switch(0, "contact"),)
    touches = np.asarray(find_feet_on_floor(feet, step, size, settings).any(1))
    return switches_from_contact(_remove_short_phases(touches, settings.contact.shortest / step))


def find_feet_on_floor(
    feet: Float, step: float, size: float, settings: LocomotionSettings | None = None
) -> Bool:
    """Returns (F, K) True for feet of the performer who touch the floor. The criteria are those of
    :func:`find_switches`."""
    settings = settings or LocomotionSettings()
    contact = settings.contact
    feet = np.asarray(feet, np.float64)
    if len(feet) < 3:
        return np.ones(feet.shape[:2], np.bool_)
    floor = np.percentile(feet[:, :, 1].min(1), 5)
    velocity = np.gradient(feet, step, axis=0)
    # A runner's standing foot rolls fast, but it is slow relative to the mean of all feet, which moves at the
    # running speed.
    runs = np.linalg.norm(velocity.mean(1)[:, [0, 2]], axis=1)
    slow = np.maximum(contact.speed * size, settings.runner * runs)
    stands = np.empty(feet.shape[:2], np.bool_)
    pairs = zip(np.moveaxis(feet, 1, 0), np.moveaxis(velocity, 1, 0), strict=True)
    for k, (foot, moves) in enumerate(pairs):
        own_height = max(floor, np.percentile(foot[:, 1], 5))
        speed = np.linalg.norm(moves, axis=1) / slow
        down = np.empty(len(feet), np.bool_)
        detect_contact_frames(
            foot[:, 1] - own_height, speed, contact.height * size, 1.0, contact.release, down
        )
        stands[:, k] = down
    return stands


def switches_from_contact(touches: Bool) -> tuple[Switch, ...]:
    """Returns the switches of a performer from the frames (F,) in which the performer touches the floor."""
    frames = [0, *(np.flatnonzero(np.diff(touches.astype(np.int8))) + 1)]
    return tuple(Switch(int(f), "contact" if touches[f] else "flight") for f in frames)


def place_motion(
    places: Float,
    yaw: Float,
    step: float,
    switches: Sequence[Switch],
    feet: Sequence[int],
    settings: LocomotionSettings | None = None,
    stands: Bool | None = None,
) -> PlacedMotion:
    """Places control points in the world.

    Args:
        places: (F, P, 3) metres in the mesh's frame.
        yaw: (F,) radians, the yaw of the performer.
        step: seconds between frames.
        switches: ascending, the first at frame 0.
        feet: numbers of the control points that the mesh can stand on.
        stands: (F, K) True for feet that the performer stands on (:func:`find_feet_on_floor`). Each of these
            feet is the anchor until it is lifted. If None, the lowest foot is the anchor, independent of the
            performer.

    Raises:
        InputError: if switches are out of order or outside the motion, or if ``feet`` is empty.
    """
    settings = settings or LocomotionSettings()
    rotated = rotate_about_y(np.asarray(places, np.float64), np.asarray(yaw)[:, None])
    touches = _touches_floor(switches, len(rotated))
    if len(feet) == 0:
        raise InputError(
            "the puppet has no feet",
            where="locomotion",
            remedy="Choose the control points that the puppet stands on.",
        )
    root_path = _RootPath(rotated, np.asarray(feet, np.int64), step, settings, stands)
    for first, last in find_runs(touches) if touches.any() else []:
        root_path.compute_flight(first)
        root_path.compute_contact(first, last)
    root_path.compute_flight(len(rotated))
    return PlacedMotion(
        rotated + root_path.root[:, None],
        root_path.root,
        root_path.anchors,
        switches_from_contact(root_path.anchors >= 0),
    )


class _RootPath:
    """The root of the mesh, computed frame by frame from the start."""

    def __init__(
        self, turned: Float, feet: Int, step: float, settings: LocomotionSettings, stands: Bool | None
    ) -> None:
        self._turned, self._feet = np.ascontiguousarray(turned), feet
        self._step, self._settings = step, settings
        self._stands = np.zeros((len(turned), len(feet)), np.bool_) if stands is None else stands
        self._lowest = -turned[:, feet, 1].min(1)
        self._grip = settings.grip * (float(np.linalg.norm(np.ptp(turned[0], axis=0))) or 1.0)
        self.root = np.zeros((len(turned), 3))
        self.root[0, 1] = self._lowest[0]
        self.anchors = np.full(len(turned), -1, np.int64)
        self._done = 0

    def compute_contact(self, first: int, last: int) -> None:
        """Computes the roots and anchors of frames ``first`` to ``last``, which have floor contact."""
        first = max(first, self._done)
        choose_anchors(
            self._turned, self._feet, self._stands, self._grip, first, last, self.root, self.anchors
        )
        self._done = max(self._done, last + 1)

    def compute_flight(self, until: int) -> None:
        """Computes the roots in flight, from the last finished frame to the frame ``until``."""
        start = self._done
        if start >= until:
            return
        before = max(start - 1, 0)
        velocity = self._root_velocity(before)
        times = (np.arange(start, until) - before) * self._step
        fall = 0.5 * self._settings.gravity * times**2
        if self._settings.landing == "timed" and until < len(self.root):
            whole = (until - before) * self._step
            drop = 0.5 * self._settings.gravity * whole**2
            velocity[1] = (self._lowest[until] - self.root[before, 1] + drop) / whole
        self.root[start:until] = self.root[before] + velocity * times[:, None]
        self.root[start:until, 1] -= fall
        self._land_early(start, until)
        self._done = until

    def _land_early(self, start: int, until: int) -> None:
        """Handles an early landing: if the mesh reaches the floor before the performer, it stands from then
        on.
        """
        under = np.flatnonzero(self.root[start:until, 1] < self._lowest[start:until])
        if len(under) == 0:
            return
        if self._settings.landing == "timed":
            self.root[start:until, 1] = np.maximum(self.root[start:until, 1], self._lowest[start:until])
        else:
            self._done = start + int(under[0])
            self.compute_contact(self._done, until - 1)

    def _root_velocity(self, frame: int) -> Float:
        """Returns the velocity (3,) of the root in contact in metres per second, averaged up to ``frame``."""
        earlier = frame
        longest = max(int(round(self._settings.throw / self._step)), 1)
        while earlier > 0 and frame - earlier < longest and self.anchors[earlier - 1] >= 0:
            earlier -= 1
        if earlier == frame:
            return np.zeros(3)
        return np.asarray((self.root[frame] - self.root[earlier]) / ((frame - earlier) * self._step))


def check_switches(switches: Sequence[Switch], frames: int) -> None:
    """Checks that switches begin at frame 0, ascend, and lie within ``frames``.

    Raises:
        InputError: if they do not.
    """
    switch_frames = [switch.frame for switch in switches]
    if (
        not switch_frames
        or switch_frames[0] != 0
        or any(b <= a for a, b in pairwise(switch_frames))
        or switch_frames[-1] >= frames
    ):
        advice = f"Start with frame 0, use ascending frames, and stay below frame {frames}."
        raise InputError(
            f"the floor contact switches have invalid frames: {switch_frames}",
            where="locomotion",
            remedy=advice,
        )


def _touches_floor(switches: Sequence[Switch], frames: int) -> Bool:
    """Returns (F,) True in frames with contact."""
    check_switches(switches, frames)
    switch_frames = [switch.frame for switch in switches]
    out = np.empty(frames, np.bool_)
    for switch, end in zip(switches, [*switch_frames[1:], frames], strict=True):
        out[switch.frame : end] = switch.kind == "contact"
    return out


def _remove_short_phases(touches: Bool, shortest: float) -> Bool:
    """Removes flights and then contacts that are shorter than ``shortest`` frames."""
    out = touches.copy()
    for kind in (False, True):
        for a, b in find_runs(out == kind):
            # A contact at the start or the end of the take may be a part of a longer one. So do not remove
            # it, even if it is short.
            cut = kind and (a == 0 or b == len(out) - 1)
            if not cut and b - a + 1 < shortest:
                out[a : b + 1] = not kind
    return out
