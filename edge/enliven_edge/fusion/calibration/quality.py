"""Evaluates a calibration and advises the user. A bad result is therefore not accepted silently."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from enliven.arrays import Float, Int
from enliven.person import Joint
from enliven.space.rigid_transform import angle_between, invert, transform_points
from enliven_edge.fusion.calibration.matching import BodyMatch
from enliven_edge.fusion.calibration.refinement import Fit, refine
from enliven_edge.fusion.settings import MAX_TRACK_GAP_S, CalibrationSettings

_MAX_RESIDUAL_M = 0.15
"""Maximum root mean square distance in metres between the joints of two sensors that is accepted."""
_MAX_POSITION_SIGMA_CM = 5.0
"""Maximum accepted uncertainty of a sensor's position in centimetres."""
_MAX_DIRECTION_SIGMA_DEG = 2.0
"""Maximum accepted uncertainty of a sensor's direction in degrees."""

_JACKKNIFE_BLOCKS = 8
"""Number of jackknife blocks, both of the walk and of facing directions. Each block still contains several
seconds of walking."""
_FLOOR_CELL_M = 0.5
"""Cell size in metres for counting the walked floor."""
_LEFTS, _RIGHTS = [Joint.SHOULDER_LEFT, Joint.HIP_LEFT], [Joint.SHOULDER_RIGHT, Joint.HIP_RIGHT]
_GOOD_DISTANCE_M = 2.5
"""Distance in metres from a sensor at which people are seen well."""


class Verdict(StrEnum):
    """The permitted use of a calibration."""

    GOOD = "good"
    WALK_ON = "walk on"
    AMBIGUOUS = "ambiguous"
    NO_MATCH = "no match"


@dataclass(frozen=True)
class Quality:
    """The quality of the fit of two sensors.

    Attributes:
        verdict: the permitted use of the calibration.
        rms: robust root mean square distance in metres between the joints of both sensors; nan without a
            match.
        doubt_cm, doubt_deg, doubt_ms: standard deviations in centimetres, degrees and milliseconds, of the
            position (where people walked), the direction and the clock.
        seconds: time for which both sensors saw the same person.
        length, breadth: extent of the walked floor in metres, in its long and its narrow direction.
        cells: number of walked squares of 0.5 m.
        swapped: fraction of the moments at which the two sensors exchanged left and right.
        advice: one sentence to the user; empty if the quality is good.
    """

    verdict: Verdict
    rms: float
    doubt_cm: float
    doubt_deg: float
    doubt_ms: float
    seconds: float
    length: float
    breadth: float
    cells: int
    swapped: float
    advice: str


def evaluate_fit(
    fit: Fit, matches: tuple[BodyMatch, ...], rivals: list[Fit], name: str, settings: CalibrationSettings
) -> Quality:
    """Returns the quality of a fit of sensor b to sensor a.

    Args:
        fit: the fit.
        matches: the matched bodies.
        rivals: other placements of the sensors that explain the bodies equally well.
        name: the user's name of sensor b.
        settings: the settings.
    """
    position_cm, direction_deg, clock_ms = _estimate_uncertainty(fit, matches, settings)
    length, breadth, narrow_axis = _measure_walk(fit.hips)
    seconds = _count_seconds(fit.times)
    verdict, advice = Verdict.GOOD, ""
    if fit.rms > _MAX_RESIDUAL_M:
        verdict = Verdict.NO_MATCH
        advice = (
            f"the joints from {name} differ by {100 * fit.rms:.0f} cm from those of the other sensor: let "
            "only one person walk around"
        )
    elif seconds < settings.overlap:
        verdict = Verdict.WALK_ON
        advice = (
            f"both sensors saw the same person for only {seconds:.1f} s: keep walking where {name} sees "
            "you, too"
        )
    elif breadth < settings.narrowest:
        verdict = Verdict.WALK_ON
        direction = _advise_walk(fit, narrow_axis, name)
        advice = f"the walked area was {length:.1f} m long and {breadth:.1f} m wide: {direction}"
    elif rivals:
        verdict = Verdict.AMBIGUOUS
        rival = _describe_rival(fit, rivals[0])
        advice = f"the pose of {name} is ambiguous ({rival}): walk in a curve, lift one arm, and turn around"
    elif position_cm > _MAX_POSITION_SIGMA_CM or direction_deg > _MAX_DIRECTION_SIGMA_DEG:
        verdict = Verdict.WALK_ON
        accuracy = f"{position_cm:.1f} cm and {direction_deg:.1f} degrees"
        advice = f"the pose of {name} is only accurate to {accuracy}: keep walking, and turn around"
    return Quality(
        verdict, fit.rms, position_cm, direction_deg, clock_ms, seconds, length, breadth,
        len(np.unique(np.floor(fit.hips[:, [0, 2]] / _FLOOR_CELL_M), axis=0)),
        float(np.mean(fit.swapped)), advice,
    )  # fmt: skip


def make_no_match_quality(a: str, b: str, blind: str | None) -> Quality:
    """Returns the quality if both sensors never saw the same person.

    Args:
        a, b: the names of the sensors.
        blind: the sensor that never saw a person, or None.
    """
    nan = float("nan")
    advice = f"{a} and {b} never saw a performer at the same time: walk for longer where both sensors see you"
    if blind is not None:
        advice = f"{blind} never saw a performer: walk where this sensor sees you from head to foot"
    return Quality(Verdict.NO_MATCH, nan, nan, nan, nan, 0.0, 0.0, 0.0, 0, 0.0, advice)


def _estimate_uncertainty(
    fit: Fit, matches: tuple[BodyMatch, ...], settings: CalibrationSettings
) -> tuple[float, float, float]:
    """Returns one standard deviation each of position, direction and clock: centimetres, degrees and
    milliseconds.

    Each is the largest of three estimates: the formal one of the normal equations, and two jackknives. One
    jackknife leaves out eighths of the walk, the other leaves out each of eight facing directions. They are
    needed because a tracker's errors change slowly and depend on the viewing direction, which the formal
    estimate ignores.
    """
    covariance = np.linalg.pinv(fit.precision + 1e-9 * np.eye(7))
    formal = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    radius = float(np.sqrt(((fit.hips - fit.hips.mean(0))[:, [0, 2]] ** 2).sum(1).mean()))
    edges = np.quantile(fit.times, np.linspace(0.0, 1.0, _JACKKNIFE_BLOCKS + 1))[1:-1]
    spread = np.maximum(
        _jackknife(fit, matches, [np.digitize(m.times, edges) for m in matches], settings),
        _jackknife(fit, matches, [_compute_facing_octants(m) for m in matches], settings),
    )
    direction = max(float(np.linalg.norm(formal[:3])), float(spread[1]))
    position = float(np.hypot(max(float(np.linalg.norm(formal[3:6])), float(spread[0])), direction * radius))
    return 100 * position, float(np.degrees(direction)), 1e3 * max(float(formal[6]), float(spread[2]))


def _jackknife(
    fit: Fit, matches: tuple[BodyMatch, ...], blocks: list[Int], settings: CalibrationSettings
) -> Float:
    """Returns (3,) one standard deviation in metres, radians and seconds, by the jackknife.

    The fit is repeated with each block left out once.

    Args:
        fit: the fit to all blocks.
        matches: the matched bodies.
        blocks: by match, (N,) the block number of each of its moments, from 0.
        settings: the settings.
    """
    block_index = transform_points(invert(fit.a_from_b), fit.centre)
    changes = []
    for block in range(_JACKKNIFE_BLOCKS):
        if not any((b == block).any() for b in blocks):
            continue
        kept_matches = tuple(
            BodyMatch(m.a, m.b, m.times[b != block]) for m, b in zip(matches, blocks, strict=True)
        )
        refitted = refine(kept_matches, fit.a_from_b, fit.lag, settings, steps=4, frames=300)
        if refitted is not None:
            shift = np.linalg.norm(transform_points(refitted.a_from_b, block_index) - fit.centre)
            changes.append((shift, angle_between(fit.a_from_b, refitted.a_from_b), refitted.lag - fit.lag))
    if len(changes) < 2:
        return np.zeros(3)
    own_blocks = (len(changes) - 1) / len(changes)
    return np.asarray(np.sqrt(own_blocks * (np.array(changes) ** 2).sum(0)))


def _compute_facing_octants(match: BodyMatch) -> Int:
    """Returns the person's facing direction (N,) as seen by the first sensor, one of eight."""
    joints, _, _ = match.a.interpolate(match.times, MAX_TRACK_GAP_S)
    left_axis = joints[:, _LEFTS].mean(1) - joints[:, _RIGHTS].mean(1)
    angles = np.arctan2(left_axis[:, 2], left_axis[:, 0]) / (2 * np.pi)
    return np.asarray(np.floor(_JACKKNIFE_BLOCKS * (angles % 1.0)).clip(0, _JACKKNIFE_BLOCKS - 1), np.int64)


def _measure_walk(hips: Float) -> tuple[float, float, Float]:
    """Returns the length and breadth of the walked floor in metres, and the (3,) unit vector along its
    breadth.
    """
    floor_points = hips[:, [0, 2]]
    _, axes = np.linalg.eigh(
        np.cov((floor_points - floor_points.mean(0)).T) if len(floor_points) > 1 else np.eye(2)
    )
    low, high = np.quantile(floor_points @ axes, [0.03, 0.97], axis=0)
    return float(high[1] - low[1]), float(high[0] - low[0]), np.array([axes[0, 0], 0.0, axes[1, 0]])


def _count_seconds(times: Float) -> float:
    """Returns the observed time in seconds.

    It is the number of tenths of a second that contain an element of ``times``, divided by ten.
    """
    return 0.1 * len(np.unique(np.floor(times / 0.1)))


def _advise_walk(fit: Fit, narrow_axis: Float, name: str) -> str:
    """Returns advice on where to walk to widen the narrow direction, from sensor b's view."""
    b_from_a = invert(fit.a_from_b)
    centre, direction = transform_points(b_from_a, fit.centre), b_from_a[:3, :3] @ narrow_axis
    if abs(direction[0]) >= abs(direction[2]):
        return f"keep walking, to the {'left' if centre[0] > 0 else 'right'} of sensor {name}"
    is_near = -centre[2] > _GOOD_DISTANCE_M
    return f"keep walking, {'nearer to' if is_near else 'farther from'} sensor {name}"


def _describe_rival(fit: Fit, rival: Fit) -> str:
    degrees = np.degrees(angle_between(fit.a_from_b, rival.a_from_b))
    if degrees > 15.0:
        return f"possibly turned by {degrees:.0f} degrees"
    distance = np.linalg.norm(
        transform_points(rival.a_from_b, transform_points(invert(fit.a_from_b), fit.centre)) - fit.centre
    )
    return f"possibly moved by {distance:.1f} m"
