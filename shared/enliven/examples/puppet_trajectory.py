"""The solved motion of a layer: control points per frame, the path in the world, and looping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int
from enliven.document import Switch
from enliven.skeletons.facing import rotate_about_y


@dataclass(frozen=True, eq=False)
class PuppetMotion:
    """The solved motion of a layer over its whole take. Arrays have one entry per frame.

    Attributes:
        step: seconds between frames.
        points: numbers of the control points that the layer moves.
        places: (F, P, 3) control points in the mesh's own frame, metres; points that the layer does not move
            are at rest.
        rest: (P, 3) metres, the control points at rest.
        weight: weight of the layer.
        yaw: (F,) rotation about +Y since the first frame, radians; 0 if the layer does not travel.
        root: (F, 3) position of the root, metres; 0 if the layer does not travel.
        path: (F, 3) metres on the floor, the performer's path scaled to the puppet's stride. The root stays
            near it.
        anchors: (F,) the number of the control point that stays in place on the floor. It is -1 in flight,
            and if the puppet does not step.
        switches: the times at which contact and flight begin; empty if the layer does not travel.
        travels: True if the layer moves the puppet through the world.
        notes: sentences for the user about assumptions that were made.
    """

    step: float
    points: tuple[int, ...]
    places: Float
    rest: Float
    weight: float
    yaw: Float
    root: Float
    path: Float
    anchors: Int
    switches: tuple[Switch, ...]
    travels: bool
    notes: tuple[str, ...] = ()

    @property
    def frames(self) -> int:
        """The number of frames."""
        return len(self.places)

    def interpolate(self, seconds: float) -> tuple[Float, float, Float]:
        """Returns control points (P, 3), yaw and root (3,) at a time of the take, clamped to its first and
        last frame."""
        frame = float(np.clip(seconds / self.step, 0.0, self.frames - 1))
        return self.places_at(frame), *self.root_at(frame)

    def places_at(self, frame: float) -> Float:
        """Returns the control points (P, 3) in metres, interpolated at a fractional frame."""
        previous, following, part = self._frames_around(frame)
        return np.asarray((1.0 - part) * self.places[previous] + part * self.places[following])

    def frame_of(self, second: float) -> float:
        """Returns the fractional frame at a second of the take."""
        return min(second / self.step, self.frames - 1.0)

    def root_at(
        self, frame: float, rounds: int = 0, ends: tuple[float, float] | None = None
    ) -> tuple[float, Float]:
        """Returns yaw (radians) and root (3,) in metres at a fractional frame, after ``rounds`` loops of the
        range ``ends`` of the take.

        ``ends`` are two times in seconds. None loops the whole take. The anchor stays in place also between
        frames.
        """
        previous, following, part = self._frames_around(frame)
        yaw = float((1.0 - part) * self.yaw[previous] + part * self.yaw[following])
        root = (1.0 - part) * self.root[previous] + part * self.root[following]
        anchor = int(self.anchors[following])
        if anchor >= 0:
            place_before, place_after = (
                self.compute_world_position(f, anchor) for f in (previous, following)
            )
            anchor_place = (1.0 - part) * place_before + part * place_after
            rotated = [
                _turn_about_y(place - self.root[f], -self.yaw[f])
                for place, f in ((place_before, previous), (place_after, following))
            ]
            root = anchor_place - _turn_about_y((1.0 - part) * rotated[0] + part * rotated[1], yaw)
        return self._after_rounds(yaw, np.asarray(root), frame, rounds, ends)

    def _after_rounds(
        self, yaw: float, root: Float, frame: float, rounds: int, ends: tuple[float, float] | None
    ) -> tuple[float, Float]:
        """Returns the yaw and the root after whole rounds of the loop. Each round continues where the
        previous one ended.

        Round n maps x to R^n x + (1 + R + ... + R^(n-1)) offset, where R is the turn of one round. The
        formula also holds for n < 0. It is computed from the path, so that the root's distance from the path
        does not accumulate over rounds. The remaining jump at the seam is eased out within the round.
        """
        if rounds == 0 or not self.travels:
            return yaw, root
        a, b = (0, -1) if ends is None else (round(self.frame_of(end)) for end in ends)
        round_yaw = float(self.yaw[b] - self.yaw[a])
        offset = self.path[b] - _turn_about_y(self.path[a], round_yaw)
        half = np.sin(0.5 * round_yaw)
        series = rounds if abs(half) < 1e-9 else np.sin(0.5 * rounds * round_yaw) / half
        path_offset = series * _turn_about_y(offset, 0.5 * (rounds - 1) * round_yaw)
        seam_jump = self._round_offset(a, b, round_yaw) - offset
        progress = _ease_in_out((frame - a) / max((b % self.frames) - a, 1))
        remaining_part = 1.0 - progress if rounds > 0 else -progress
        seam_jump = remaining_part * _turn_about_y(
            seam_jump, (rounds - 1 if rounds > 0 else rounds) * round_yaw
        )
        return yaw + rounds * round_yaw, _turn_about_y(root, rounds * round_yaw) + path_offset + seam_jump

    def _round_offset(self, a: int, b: int, turn: float) -> Float:
        """Returns the offset (3,) of a round that begins at frame ``a``, after the previous round ended at
        frame ``b``.

        The anchor of the last frame (in flight, the root) stays in place. Heights do not change.
        """
        anchor = int(self.anchors[b])
        last, first = self.root[b], self.root[a]
        if anchor >= 0:
            last, first = self.compute_world_position(b, anchor), self.compute_world_position(a, anchor)
        return np.asarray((last - _turn_about_y(first, turn)) * [1.0, 0.0, 1.0])

    def compute_world_position(self, frame: int, point: int) -> Float:
        """Returns the world position (3,) in metres of a control point at a frame, from this layer alone."""
        mixed = self.rest[point] + self.weight * (self.places[frame, point] - self.rest[point])
        return np.asarray(_turn_about_y(mixed, self.yaw[frame]) + self.root[frame])

    def _frames_around(self, frame: float) -> tuple[int, int, float]:
        previous = min(int(frame), self.frames - 1)
        return previous, min(previous + 1, self.frames - 1), frame - previous


def _turn_about_y(vector: Float, angle: float) -> Float:
    return np.asarray(rotate_about_y(vector, np.asarray(angle)))


def _ease_in_out(part: float) -> float:
    """Returns the smoothstep of ``part``: 0 to 1 with zero slope at both ends."""
    part = min(max(part, 0.0), 1.0)
    return part * part * (3.0 - 2.0 * part)
