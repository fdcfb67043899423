"""Finds the relative poses of sensors from people who walk around: no checkerboard, no tape measure.

Bodies of two sensors are the same points in two frames of reference. The calibration also finds which bodies
are the same person, which side is left for each sensor, and the clock offsets.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.space.space_file import Place, Space, convert_to_nested_tuples
from enliven_edge.fusion.calibration.matching import BodyMatch, generate_guesses, match_bodies
from enliven_edge.fusion.calibration.pose_graph import SensorPlacement, solve_pose_graph
from enliven_edge.fusion.calibration.quality import Quality, Verdict, evaluate_fit, make_no_match_quality
from enliven_edge.fusion.calibration.refinement import Fit, are_different, refine
from enliven_edge.fusion.calibration.tracks import BodyStream
from enliven_edge.fusion.settings import CalibrationSettings

_MISSED_BODY_COST_M = 0.5
"""Cost in metres of a body that only one sensor saw, although the other sensor saw people at that time."""
_MAX_REFINED_PLACEMENTS = 4
"""Number of placements that are refined fully. The best placement after a quick fit is not always the best
after refinement."""
_EQUAL_COST_RATIO = 1.25
"""Factor on the best cost up to which another placement counts as an equally good explanation."""


@dataclass(frozen=True)
class SensorPair:
    """The result for two sensors. ``fit`` is None if both sensors never saw the same person."""

    a: str
    b: str
    fit: Fit | None
    quality: Quality

    @property
    def is_good(self) -> bool:
        """Returns True if the result may be used."""
        return self.quality.verdict is Verdict.GOOD


@dataclass(frozen=True)
class Calibration:
    """The poses of all sensors.

    Attributes:
        sensors: their identities; the first one's frame is the world.
        world_from_sensor: by sensor, the (4, 4) transform to the world from the sensor's level frame, in
            which its bodies are given.
        clock_offset_ns: by sensor, nanoseconds to add to its clock to get the first sensor's clock.
        pairs: the result of every pair of sensors.
        loop_cm, loop_deg: maximum loop closure error, in position and rotation, of chains of sensors that
            form a loop.
    """

    sensors: tuple[str, ...]
    world_from_sensor: dict[str, Float]
    clock_offset_ns: dict[str, int]
    pairs: tuple[SensorPair, ...]
    loop_cm: float
    loop_deg: float

    @property
    def is_good(self) -> bool:
        """Returns True if every sensor is connected to the first one through good pairs."""
        return not self.find_unconnected(lambda pair: pair.is_good)

    def find_unconnected(self, usable: Callable[[SensorPair], bool]) -> tuple[str, ...]:
        """Returns the sensors that no chain of usable pairs connects to the first one."""
        connected = {self.sensors[0]}
        for _ in self.sensors:
            for pair in filter(usable, self.pairs):
                if {pair.a, pair.b} & connected:
                    connected |= {pair.a, pair.b}
        return tuple(name for name in self.sensors if name not in connected)

    def space(self, level_from_camera: Mapping[str, Float] | None = None) -> Space:
        """Returns the calibrated space that is written to the file.

        Args:
            level_from_camera: by depth sensor, the (4, 4) pose of its camera in the sensor's level frame.
        """
        cameras = level_from_camera or {}
        places = {}
        for name, level in self.world_from_sensor.items():
            camera = convert_to_nested_tuples(level @ cameras[name]) if name in cameras else None
            places[name] = Place(convert_to_nested_tuples(level), camera, self.clock_offset_ns[name])
        return Space(places)

    @property
    def advice(self) -> list[str]:
        """Returns advice: one sentence for each pair that an unconnected sensor needs.

        The list is empty if the calibration is good.
        """
        unconnected = self.find_unconnected(lambda pair: pair.is_good)
        return [p.quality.advice for p in self.pairs if p.quality.advice and {p.a, p.b} & set(unconnected)]


def calibrate(
    streams: Sequence[BodyStream],
    settings: CalibrationSettings | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Calibration:
    """Finds the poses of sensors that saw these bodies simultaneously in one space.

    Args:
        streams: the bodies of each sensor.
        settings: the settings. If None, uses the defaults.
        progress: called with the names of each pair.

    Raises:
        InputError: for fewer than two sensors, or duplicate identities.
    """
    settings = settings or CalibrationSettings()
    names = tuple(stream.sensor for stream in streams)
    _check_names(names)
    pairs = []
    for a, b in itertools.combinations(streams, 2):
        progress(f"{a.sensor} and {b.sensor}")
        pairs.append(calibrate_pair(a, b, settings))
    placement: SensorPlacement = solve_pose_graph(
        names, [(p.a, p.b, p.fit, p.is_good) for p in pairs if p.fit is not None]
    )
    first = streams[0].first_ns
    offsets = {
        sensor.sensor: first - sensor.first_ns + round(placement.lags.get(sensor.sensor, 0.0) * 1e9)
        for sensor in streams
        if sensor.sensor in placement.lags
    }
    return Calibration(
        names,
        placement.world_from_sensor,
        offsets,
        tuple(pairs),
        100 * placement.loop_error_m,
        float(np.degrees(placement.loop_error_rad)),
    )


def calibrate_pair(a: BodyStream, b: BodyStream, settings: CalibrationSettings) -> SensorPair:
    """Finds the pose of sensor b relative to sensor a, starting from each of the first guesses."""
    known_lag = (b.first_ns - a.first_ns) * 1e-9
    ranked_fits: list[tuple[float, Fit]] = []
    for guess in generate_guesses(a, b, known_lag, settings):
        quick_fit = refine(guess.matches, guess.a_from_b, guess.lag, settings, steps=4, frames=120)
        if quick_fit is not None:
            ranked_fits.append((_compute_score(a, b, quick_fit, guess.matches, settings), quick_fit))
    ranked_fits.sort(key=lambda entry: entry[0])
    refined: list[tuple[float, Fit, tuple[BodyMatch, ...]]] = []
    for _, quick_fit in _select_distinct(ranked_fits):
        final = _refine_guess(a, b, quick_fit, settings)
        if final is not None:
            refined.append((_compute_score(a, b, *final, settings), *final))
    if not refined:
        blind_sensor = next((s.sensor for s in (a, b) if not s.tracks), None)
        return SensorPair(a.sensor, b.sensor, None, make_no_match_quality(a.sensor, b.sensor, blind_sensor))
    refined.sort(key=lambda entry: entry[0])
    score, fit, matches = refined[0]
    equal_fits = [
        other
        for cost, other, _ in refined[1:]
        if cost < _EQUAL_COST_RATIO * score + 1e-4 and are_different(fit, other)
    ]
    return SensorPair(a.sensor, b.sensor, fit, evaluate_fit(fit, matches, equal_fits, b.sensor, settings))


def _select_distinct(ranked_fits: list[tuple[float, Fit]]) -> list[tuple[float, Fit]]:
    """Returns the best few guesses, without those that are similar to a better one."""
    distinct: list[tuple[float, Fit]] = []
    for score, fit in ranked_fits:
        if all(are_different(fit, other) or abs(fit.lag - other.lag) > 0.1 for _, other in distinct):
            distinct.append((score, fit))
        if len(distinct) == _MAX_REFINED_PLACEMENTS:
            break
    return distinct


def _refine_guess(
    a: BodyStream, b: BodyStream, quick: Fit, settings: CalibrationSettings
) -> tuple[Fit, tuple[BodyMatch, ...]] | None:
    """Refines a guess. It matches all people and refines twice, because a better placement gives better
    matches.
    """
    fit = quick
    matches: tuple[BodyMatch, ...] = ()
    for _ in range(2):
        matches = match_bodies(a, b, fit.a_from_b, fit.lag)
        better = refine(matches, fit.a_from_b, fit.lag, settings)
        if better is None:
            return None
        fit = better
    return fit, matches


def _compute_score(
    a: BodyStream, b: BodyStream, fit: Fit, matches: tuple[BodyMatch, ...], settings: CalibrationSettings
) -> float:
    """Returns the disagreement in metres per body, with a cost for bodies that only one sensor saw.

    Short overlaps agree more easily by chance, so their score is increased.
    """
    times = np.arange(0.0, a.duration + 1e-9, 0.1)
    common_people = np.minimum(_count_people(a, times), _count_people(b, times - fit.lag)).sum()
    have = min(float(common_people), sum(10 * _measure_shared_duration(m, b, fit.lag) for m in matches))
    if common_people < 1:
        return np.inf
    cost = (have * fit.cost + (common_people - have) * _MISSED_BODY_COST_M) / common_people
    # If all else is equal, prefer the assignment that exchanges left and right in fewer bodies.
    return float(cost * (max(len(times), 1) / common_people) ** 0.25 * (1.0 + 0.15 * fit.swapped.mean()))


def _count_people(stream: BodyStream, times: Float) -> Float:
    """Returns the number (N,) of people that a sensor reports at each time."""
    count = np.zeros(len(times))
    for track in stream.tracks:
        nearest_frame = np.clip(np.searchsorted(track.times, times), 1, max(len(track.times) - 1, 1))
        interval = np.minimum(len(track.times) - 1, nearest_frame)
        max_gap = np.minimum(
            np.abs(track.times[interval] - times), np.abs(track.times[nearest_frame - 1] - times)
        )
        count += max_gap < 0.1
    return count


def _measure_shared_duration(match: BodyMatch, b: BodyStream, lag: float) -> float:
    """Returns the duration in seconds for which both sensors see the person of a match."""
    times = match.times[_count_people(BodyStream(b.sensor, 0, (match.b,)), match.times - lag) > 0]
    return 0.1 * len(np.unique(np.floor(times / 0.1)))


def _check_names(names: Sequence[str]) -> None:
    if len(names) < 2:
        raise InputError("there is only one sensor", where="calibration", remedy="Use two or more sensors.")
    duplicates = [name for name in names if names.count(name) > 1]
    if duplicates:
        raise InputError(
            f"two sensors are called {duplicates[0]!r}",
            where="calibration",
            remedy="Give each sensor another name: left=FIRST right=SECOND.",
        )
