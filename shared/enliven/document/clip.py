"""A clip: the motion of a skeleton over time, as world rotations of its bones relative to the rest pose.

A clip is a recorded or imported performance, or an animation of one bone by keyframes. In the latter case,
its frames are computed from the keyframes.

    clip_from_keys("arm keys", "arm", [MotionKey(0.5, (0.0, 40.0, 0.0)), MotionKey(1.0, ease="linear")])
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float, freeze
from enliven.document.keys import KEY_STEP, MotionKey, key_values, sort_keys
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.rotation import from_rotation_vector, normalized, rotate, stretch_from_strain

_SAME_KEY = 1e-6
"""Maximum difference in time, in seconds, between equal keys. It is the rounding error of float32 after a
minute."""
_KEY_INTERVAL_S = 1 / 120
"""Interval in seconds between the additional keys in a piece of a cubic curve that was cut. It keeps the
error of the curve below 1e-6."""


@dataclass(frozen=True, eq=False)
class FineFrames:
    """A clip's motion at unevenly spaced times. It is used if evenly spaced frames would lose keys or jumps.

    Attributes:
        seconds: (K,) increasing times from the clip's first frame to its last.
        turns, root, offsets, strains, mirrors: tracks of K frames each, in the format of :class:`Clip`.

    Raises:
        InputError: if the arrays do not fit together, or the times do not rise.
    """

    seconds: Float
    turns: Float
    root: Float
    offsets: Float | None = None
    strains: Float | None = None
    mirrors: Float | None = None

    def __post_init__(self) -> None:
        track_names = ("seconds", "turns", "root", "offsets", "strains", "mirrors")
        freeze(self, *(name for name in track_names if getattr(self, name) is not None))
        rows = [getattr(self, name) for name in track_names if getattr(self, name) is not None]
        rising = self.seconds.ndim == 1 and len(self.seconds) > 1 and bool((np.diff(self.seconds) > 0).all())
        if not rising or not all(len(r) == len(self.seconds) and np.isfinite(r).all() for r in rows):
            raise InputError(
                "the frames between the regular frames have unequal counts, unordered times or values "
                "that are not finite",
                where="clip",
                remedy="Import the clip again.",
            )

    def scale_and_move(self, scale: float, by: Float) -> FineFrames:
        """Returns the motion for a skeleton that was scaled, then moved by ``by`` (3,) metres."""
        offsets = None if self.offsets is None else self.offsets * scale
        return replace(self, root=self.root * scale + by, offsets=offsets)

    def cut(self, start: float, stop: float) -> FineFrames | None:
        """Returns the frames from ``start`` to ``stop`` seconds, relative to ``start``, or None if there are
        fewer than two."""
        inside = (self.seconds > start - 1e-9) & (self.seconds < stop + 1e-9)
        if inside.sum() < 2:
            return None
        tracks = (self.turns, self.root, self.offsets, self.strains, self.mirrors)
        rows = (None if track is None else track[inside] for track in tracks)
        return FineFrames(self.seconds[inside] - start, *rows)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class CubicKeys:
    """The keys of a cubic curve, as glTF 2.0 (appendix C) interpolates CUBICSPLINE keys.

    Attributes:
        bone: the number of the bone that the curve moves.
        seconds: (K,) increasing times of the keys.
        values: (K, 4) unit quaternions (w, x, y, z), the rotation of the bone relative to its parent, or
            (K, 3) metres, the position of the root. The components of rotations are interpolated separately
            and normalised afterwards.
        slopes: (K, 2, 4 or 3) the incoming and the outgoing tangent of each key: derivatives per second.

    Raises:
        InputError: if the arrays do not fit together, or the times do not rise.
    """

    bone: int
    seconds: Float
    values: Float
    slopes: Float

    def __post_init__(self) -> None:
        freeze(self, "seconds", "values", "slopes")
        count, width = len(self.seconds), 4 if self.values.shape[-1:] == (4,) else 3
        fits = self.values.shape == (count, width) and self.slopes.shape == (count, 2, width) and count > 0
        finite = all(np.isfinite(array).all() for array in (self.seconds, self.values, self.slopes))
        if not (fits and finite and (np.diff(self.seconds) > 0).all()):
            raise InputError(
                "the cubic keyframes have unequal counts, unordered times or values that are not finite",
                where="clip",
                remedy="Import the clip again.",
            )

    @property
    def turns(self) -> bool:
        """True if the curve rotates a bone. Otherwise it moves the root."""
        return bool(self.values.shape[1] == 4)

    def evaluate(self, seconds: Float) -> Float:
        """Returns the values at times (T,): unit quaternions (T, 4) or metres (T, 3). Before the first and
        after the last key, values are constant.
        """
        values, _ = self._cubic_values(np.clip(seconds, self.seconds[0], self.seconds[-1]))
        return normalized(values) if self.turns else values

    def slope(self, seconds: Float) -> Float:
        """Returns the time derivative (T, 4 or 3) of :meth:`at`, per second, at times between the first and
        last key.
        """
        values, slope = self._cubic_values(seconds)
        if not self.turns:
            return slope
        length = np.linalg.norm(values, axis=1, keepdims=True)
        return np.asarray(_tangential_slopes(values / length, slope) / length)

    def _cubic_values(self, seconds: Float) -> tuple[Float, Float]:
        """Returns the cubic polynomials (T, C) and their derivatives, before rotations are normalised."""
        if len(self.seconds) == 1:
            values = np.repeat(self.values, len(seconds), 0)
            return values, np.zeros_like(values)
        k = np.clip(np.searchsorted(self.seconds, seconds, "right") - 1, 0, len(self.seconds) - 2)
        gap = (self.seconds[k + 1] - self.seconds[k])[:, None]
        s = (seconds - self.seconds[k])[:, None] / gap
        start_value, out_tangent = self.values[k], self.slopes[k, 1] * gap
        end_value, in_tangent = self.values[k + 1], self.slopes[k + 1, 0] * gap
        curve = (2 * s**3 - 3 * s**2 + 1) * start_value + (s**3 - 2 * s**2 + s) * out_tangent
        curve += (3 * s**2 - 2 * s**3) * end_value + (s**3 - s**2) * in_tangent
        slope = (
            (6 * s**2 - 6 * s) * (start_value - end_value)
            + (3 * s**2 - 4 * s + 1) * out_tangent
            + (3 * s**2 - 2 * s) * in_tangent
        )
        return np.asarray(curve), np.asarray(slope / gap)

    def cut(self, start: float, stop: float) -> CubicKeys:
        """Cuts the curve to the range from ``start`` to ``stop`` seconds, with a new key at each cut end.

        All keys in the range are kept. A curve piece that was cut gets additional keys, because a part of a
        normalised cubic is not exactly a normalised cubic.
        """
        first, last = max(start, float(self.seconds[0])), min(stop, float(self.seconds[-1]))
        if first >= last:
            # All keys are before or after the range, so the curve is constant.
            key_index = np.array([start])
            return CubicKeys(
                self.bone, key_index, self.evaluate(key_index), np.zeros((1, 2, self.values.shape[1]))
            )
        extra_times = list[Float]()
        for cut in (first, last):
            nearest = int(np.abs(self.seconds - cut).argmin())
            if abs(self.seconds[nearest] - cut) > _SAME_KEY:
                k = int(np.searchsorted(self.seconds, cut)) - 1
                low, high = max(first, self.seconds[k]), min(last, self.seconds[k + 1])
                extra_times.append(np.linspace(low, high, int((high - low) / _KEY_INTERVAL_S) + 2))
        own_times = self.seconds[(self.seconds > first - _SAME_KEY) & (self.seconds < last + _SAME_KEY)]
        seconds = np.unique(np.concatenate([own_times, *extra_times]))
        seconds = seconds[np.diff(seconds, prepend=-np.inf) > _SAME_KEY]
        slopes = np.repeat(self.slope(seconds)[:, None], 2, 1)
        key_index = np.minimum(np.searchsorted(self.seconds, seconds - _SAME_KEY), len(self.seconds) - 1)
        is_own = np.abs(self.seconds[key_index] - seconds) <= _SAME_KEY
        for side, step in ((0, -1), (1, 1)):
            own_slopes = self.slopes[key_index, side]
            slopes[is_own, side] = _tangential_slopes(self.values[key_index], own_slopes)[is_own]
            # An original key keeps its exact slope on each side where the piece was not cut.
            neighbour_index = np.clip(np.arange(len(seconds)) + step, 0, len(seconds) - 1)
            is_uncut = (
                is_own & is_own[neighbour_index] & (np.abs(key_index[neighbour_index] - key_index) == 1)
            )
            slopes[is_uncut, side] = own_slopes[is_uncut]
        return CubicKeys(self.bone, seconds, self.evaluate(seconds), slopes)

    def retime(self, speed: float, begin: float) -> CubicKeys:
        """Returns the curve played ``speed`` times as fast, with its time 0 at ``begin`` seconds."""
        return replace(self, seconds=begin + self.seconds / speed, slopes=self.slopes * speed)

    def scale_and_move(self, scale: float, by: Float) -> CubicKeys:
        """Returns the motion for a skeleton that was scaled, then moved by ``by`` (3,) metres."""
        if self.turns:
            return self
        return replace(self, values=self.values * scale + by, slopes=self.slopes * scale)


def _tangential_slopes(values: Float, slopes: Float) -> Float:
    """Removes the component of slopes that would change the length of unit quaternions (K, 4).

    Slopes of positions (K, 3) are returned unchanged.
    """
    if values.shape[1] != 4:
        return slopes
    return np.asarray(slopes - values * (values * slopes).sum(1, keepdims=True))


@dataclass(frozen=True, eq=False)
class Clip:
    """A take of a skeleton. It is immutable, so edits never change the recorded performance.

    Attributes:
        id: its name in the project.
        skeleton: the performer's skeleton at rest.
        turns: (F, N, 4) float64 unit quaternions D_j in world axes. The bone that ends at joint j points
            along D_j @ (its direction at rest), and everything rigidly attached to it is rotated by D_j. D_0
            is the rotation of the whole character.
        root: (F, 3) float64 metres, the position of joint 0.
        step: seconds from one frame to the next.
        offsets: (F, N, 3) metres, displacement of each joint along its bone's rest axes, before the bone
            stretches and rotates. None means that bones keep their lengths.
        strains: (F, N, 6) the Hencky strain log U_j of each bone in the rest axes, in the format of
            :func:`enliven.rotation.hencky_strain`. Everything rigidly attached to bone j is moved by D_j U_j,
            and joint j is at D_j U_j (its vector at rest + its offset) from its parent. None means that bones
            only rotate.
        mirrors: (F, N) 1, or -1 for a bone that is also reflected through its start joint, which negates U_j.
            None means that no bone is reflected.
        keys: the keys that the frames were computed from, in order of time. Empty for a performance.
        fine: the motion at more times, for players and exporters. None if the frames contain the complete
            motion.
        cubic: the file's own cubic keys of bones and of the root's position. A glTF export contains these
            keys if nothing else moves the character. The frames contain this motion, too.

    Raises:
        InputError: if the shapes of the arrays do not match the skeleton or values are not finite.
    """

    id: str
    skeleton: Skeleton
    turns: Float
    root: Float
    step: float
    keys: tuple[MotionKey, ...] = ()
    offsets: Float | None = None
    strains: Float | None = None
    mirrors: Float | None = None
    fine: FineFrames | None = None
    cubic: tuple[CubicKeys, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "turns", "root", *(name for name, _ in self.tracks))
        object.__setattr__(self, "cubic", tuple(self.cubic))
        if self.mirrors is not None:
            freeze(self, "mirrors")
        frames, joints = len(self.turns), len(self.skeleton)
        problem = ""
        if frames == 0:
            problem = "the clip has no frames"
        elif self.turns.shape != (frames, joints, 4) or self.root.shape != (frames, 3):
            problem = (
                f"the arrays of the clip have wrong shapes for {joints} joints: rotations "
                f"{self.turns.shape}, root {self.root.shape}"
            )
        elif not (np.isfinite(self.turns).all() and np.isfinite(self.root).all()):
            problem = "a rotation or a root position of the clip is not a finite number"
        elif any(track.shape[:2] != (frames, joints) for _, track in self.tracks):
            problem = f"the joint offsets or strains do not match {frames} frames and {joints} joints"
        elif not all(np.isfinite(track).all() for _, track in self.tracks):
            problem = "a joint offset or a strain is not a finite number"
        elif self.mirrors is not None and (
            self.mirrors.shape != (frames, joints) or not (np.abs(self.mirrors) == 1.0).all()
        ):
            problem = (
                f"the reflection signs of the joints are not 1 or -1, or do not match {frames} frames "
                f"and {joints} joints"
            )
        elif self.fine is not None and self.fine.turns.shape[1:] != (joints, 4):
            problem = f"the frames between the regular frames do not match {joints} joints"
        elif any(not 0 <= curve.bone < joints for curve in self.cubic):
            problem = f"the cubic keyframes do not match {joints} joints"
        elif not 0.0 < self.step <= 10.0:
            problem = f"the frame interval {self.step} s is not above 0 s and at most 10 s"
        if problem:
            raise InputError(problem, where=f"clip {self.id!r}", remedy="Record or import it again.")

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self.turns) - 1) * self.step

    @property
    def tracks(self) -> tuple[tuple[str, Float], ...]:
        """The optional tracks that exist, each with its name: offsets (F, N, 3) and strains (F, N, 6)."""
        candidates = (("offsets", self.offsets), ("strains", self.strains))
        return tuple((name, track) for name, track in candidates if track is not None)

    def map_values(self, change: Callable[[Float], Float]) -> Clip:
        """Returns the clip with ``change`` applied to turns, root, offsets and strains."""
        tracks: dict[str, Float] = {name: change(track) for name, track in self.tracks}
        if self.mirrors is not None:
            tracks["mirrors"] = np.where(change(self.mirrors) < 0.0, -1.0, 1.0)
        return replace(self, turns=change(self.turns), root=change(self.root), fine=None, cubic=(), **tracks)

    @property
    def finest_motion(self) -> Clip | FineFrames:
        """The object with the most complete motion: :attr:`fine` if it exists, otherwise the clip itself."""
        return self if self.fine is None else self.fine

    @property
    def links(self) -> Float:
        """(F or 1, N, 3) metres, the vector from each joint's parent to the joint before the bone stretches
        and rotates.
        """
        links = self.skeleton.vectors[None]
        links = links if self.offsets is None else links + self.offsets
        return links if self.stretch is None else apply_stretch(self.stretch, links)

    @property
    def has_deformation(self) -> bool:
        """True if bones also stretch, move or are reflected, instead of only rotating."""
        return bool(self.tracks) or self.mirrors is not None

    @property
    def stretch(self) -> Float | None:
        """(F, N, 3, 3) stretch and reflection of each bone before it rotates. None if there is neither."""
        if self.strains is None and self.mirrors is None:
            return None
        matrices = np.eye(3) if self.strains is None else stretch_from_strain(self.strains)
        return np.asarray(matrices if self.mirrors is None else matrices * self.mirrors[..., None, None])


def joint_places(clip: Clip, only: Sequence[int] | None = None) -> Float:
    """Returns the world positions (F, N, 3) of a clip's joints in metres.

    Args:
        only: the required joints. The values of all other joints are undefined. None computes all joints.
    """
    skeleton = clip.skeleton
    needed_joints = (
        range(len(skeleton)) if only is None else {j for end in only for j in skeleton.path(0, end)}
    )
    places, links = np.zeros((len(clip.turns), len(skeleton), 3)), clip.links
    places[:, 0] = clip.root
    for j in sorted(needed_joints):
        if j:
            rotated_links = rotate(clip.turns[:, j], links[:, j])
            places[:, j] = places[:, skeleton.parents[j]] + rotated_links
    return places


def apply_stretch(stretch: Float, vectors: Float) -> Float:
    """Applies stretches (..., 3, 3) to vectors (..., 3)."""
    return np.asarray(np.einsum("...ab,...b->...a", stretch, vectors))


def clip_from_keys(clip_id: str, bone: str, keys: Sequence[MotionKey]) -> Clip:
    """Builds a clip of one bone, or of a whole character, that interpolates keys. Key times are rounded to
    frames.

    Raises:
        InputError: without a key, or if two keys are on the same frame.
    """
    ordered_keys = sort_keys(keys, f"clip {clip_id!r}")
    seconds = np.arange(round(ordered_keys[-1].second / KEY_STEP) + 1) * KEY_STEP
    values = key_values(ordered_keys, seconds)
    turns = from_rotation_vector(np.radians(values[:, :3]))
    skeleton = Skeleton((bone,), np.array([-1], np.int32), np.zeros((1, 3)))
    return Clip(clip_id, skeleton, turns[:, None], values[:, 3:], KEY_STEP, ordered_keys)
