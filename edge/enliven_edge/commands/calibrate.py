"""``enliven calibrate``: finds the poses of two or more sensors from a person who walks about."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import filecmp
import itertools
import logging
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.terminal import print_line, progress_lines
from enliven.errors import InputError
from enliven.settings import load_settings
from enliven_edge.commands.progress import interruptible

if TYPE_CHECKING:
    from enliven_edge.fusion.calibration.calibration import Calibration, SensorPair
    from enliven_edge.fusion.calibration.tracks import Collector
    from enliven_edge.sensors import Sensor
    from enliven_edge.settings import EdgeSettings
    from enliven_edge.sources import Source
    from enliven_edge.tracking.settings import SceneSettings

log = logging.getLogger(__name__)

_EVALUATION_INTERVAL_S = 4.0
"""Seconds between two preliminary calibrations with live sensors. Each one slows down the trackers."""


def calibrate(
    sources: Annotated[
        list[str] | None,
        typer.Argument(help="Two or more recordings or sensors. NAME=SOURCE gives a source a name."),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Output file with the poses of the sensors.")
    ] = Path("space.toml"),
    option: Annotated[
        list[str] | None,
        typer.Option("--set", help="Option of all sensors (KEY=VALUE) or of one sensor (NAME.KEY=VALUE)."),
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(
            help="Settings file of an edge (TOML). Its sensors are calibrated if no source is named."
        ),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=1.0, help="Maximum duration in seconds, measured by each sensor's clock."),
    ] = None,
    accept_doubt: Annotated[
        bool,
        typer.Option(
            help="Write the result even if its accuracy is too low. The file then contains a warning."
        ),
    ] = False,
) -> None:
    """Find the poses of sensors from one person who walks in front of all of them. No checkerboard needed.

    Walk in curves, all over the floor, for about twenty seconds. Live sensors are read until the result is
    good enough; recordings must have been made at the same time. The previous file is kept as a backup.

    \b
      enliven calibrate LEFT.mcap RIGHT.mcap -o space.toml
      enliven calibrate left=ONE.mcap right=TWO.mcap --seconds 30 -o space.toml
      enliven calibrate --settings TWO-SENSORS.toml
      enliven edge --recording left=ONE.mcap --recording right=TWO.mcap --space space.toml
    """
    from enliven_edge.sensors import sensor_options
    from enliven_edge.settings import EdgeSettings
    from enliven_edge.sources import open_sources, parse_source, sources_from_settings

    edge_settings = load_settings(EdgeSettings, settings) if settings else EdgeSettings()
    options = sensor_options(option or [])
    sensor_sources = [parse_source(word, options, {"speed": 0.0}) for word in sources or []]
    if not sensor_sources and settings is not None:
        sensor_sources = sources_from_settings(edge_settings.sensors, settings.parent)
    if len(sensor_sources) < 2:
        raise InputError(
            "a calibration needs at least two sensors",
            where="calibrate",
            remedy="For example: enliven calibrate left.mcap right.mcap -o space.toml",
        )
    _check_recordings(sensor_sources)
    with contextlib.ExitStack() as stack:
        sensors = open_sources(sensor_sources, stack)
        scenes = {name: source.scene for name, source in zip(sensors, sensor_sources, strict=True)}
        collectors = _create_collectors(sensors, scenes, edge_settings, seconds)
        calibration = _collect_and_calibrate(collectors, edge_settings)
    for pair in calibration.pairs:
        print_line(_describe_pair(pair))
    if len(calibration.sensors) > 2:
        print_line(
            f"loop closure error of the sensors: {calibration.loop_cm:.1f} cm and "
            f"{calibration.loop_deg:.1f} degrees"
        )
    _write(calibration, collectors, output, accept_doubt)


def _check_recordings(sources: list[Source]) -> None:
    """Checks that no recording, or a copy of it, is given twice.

    A recording agrees with itself, so the result would look good without being so.

    Raises:
        InputError: if two sources read the same content.
    """
    paths = [Path(source.options["path"]) for source in sources if "path" in source.options]
    files = [path for path in paths if path.is_file()]
    for first, second in itertools.combinations(files, 2):
        if filecmp.cmp(first, second, shallow=False):
            raise InputError(
                "two sources are the same recording",
                where=str(second),
                remedy="Name one recording for each sensor. All must be recorded at the same time.",
            )


def _create_collectors(
    sensors: dict[str, Sensor],
    scenes: dict[str, SceneSettings | None],
    edge_settings: EdgeSettings,
    seconds: float | None,
) -> list[Collector]:
    """Returns a collector for each sensor, with its own tracker."""
    from enliven_edge.fusion.calibration.tracks import Collector
    from enliven_edge.fusion.live.merge import settings_before_fusion
    from enliven_edge.tracking.tracker import Tracker

    collectors = []
    for name, sensor in sensors.items():
        tracker = edge_settings.tracker
        if (scene := scenes[name]) is not None:
            tracker = dataclasses.replace(tracker, scene=scene)
        collectors.append(Collector(name, sensor, Tracker(settings_before_fusion(tracker)), seconds))
    return collectors


def _collect_and_calibrate(collectors: list[Collector], edge_settings: EdgeSettings) -> Calibration:
    """Collects bodies until the recordings end, the live data is sufficient, or the user presses Ctrl-C."""
    from enliven_edge.fusion.calibration.calibration import calibrate as calibrated
    from enliven_edge.warmup import warm_up_tracking

    with (
        progress_lines("{task.description}") as progress,
        interruptible() as stop,
    ):
        task = progress.add_task("Compiling the tracker (stored for later starts)", total=None)
        warm_up_tracking(edge_settings.tracker)
        for collector in collectors:
            collector.start()
        is_live, evaluated_at = any(not c.recorded for c in collectors), time.monotonic()
        advice = "walk around in curves"
        while not stop.is_set() and not all(c.ended for c in collectors):
            stop.wait(0.2)
            count = ", ".join(f"{c.name} {c.frames}" for c in collectors)
            progress.update(task, description=f"{count} frames; {advice if is_live else 'tracking'}")
            if is_live and time.monotonic() - evaluated_at > _EVALUATION_INTERVAL_S:
                preliminary = calibrated([c.stream() for c in collectors], edge_settings.calibration)
                evaluated_at = time.monotonic()
                if preliminary.is_good:
                    break
                advice = preliminary.advice[0] if preliminary.advice else advice
        for collector in collectors:
            collector.stop()
            if collector.failure:
                print_line(f"{collector.name}: {collector.failure}", err=True)
        progress.update(task, description="Comparing the people that the sensors tracked")
        return calibrated([c.stream() for c in collectors], edge_settings.calibration)


def _describe_pair(pair: SensorPair) -> str:
    """Returns one line that describes the calibration of a pair of sensors."""
    quality = pair.quality
    if pair.fit is None:
        return f"{pair.a} - {pair.b}: {quality.verdict}"
    swapped = (
        f", left and right swapped {100 * quality.swapped:.0f} % of the time"
        if quality.swapped > 0.02
        else ""
    )
    return (
        f"{pair.a} - {pair.b}: {quality.verdict}; joints differ by {100 * quality.rms:.1f} cm over "
        f"{quality.seconds:.0f} s in an area of {quality.length:.1f} x {quality.breadth:.1f} m{swapped}; "
        f"uncertainty: position {quality.doubt_cm:.1f} cm, direction {quality.doubt_deg:.1f} degrees, "
        f"clock {quality.doubt_ms:.0f} ms"
    )


def _write(calibration: Calibration, collectors: list[Collector], output: Path, accept_doubt: bool) -> None:
    """Writes the file if the calibration is good or the user accepts it. Otherwise raises InputError with the
    reason."""
    from enliven.space.space_file import save_space

    warnings = [] if calibration.is_good else ["NOT GOOD ENOUGH: " + "; ".join(calibration.advice)]
    missing = [name for name in calibration.sensors if name not in calibration.world_from_sensor]
    if missing or (warnings and not accept_doubt):
        backup_note = f"; {output} was not changed" if output.exists() else ""
        raise InputError(
            f"the poses of the sensors are not accurate enough yet{backup_note}",
            where="calibrate",
            remedy="; ".join(calibration.advice) + ".",
        )
    mounts = {collector.name: collector.level_from_camera for collector in collectors}
    space = calibration.space({name: mount for name, mount in mounts.items() if mount is not None})
    today = datetime.date.today().isoformat()
    remarks = [
        f"Poses of the sensors, from enliven calibrate, {today}.",
        *warnings,
        *map(_describe_pair, calibration.pairs),
    ]
    backup = save_space(output, space, remarks)
    backup_note = f" (the previous file is now {backup})" if backup else ""
    print_line(f"{output} contains the poses of {len(space.sensors)} sensors{backup_note}")
