"""Tests of the soak: its schedule, its accounting, and a short form with all programs."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
import soak
import soak_day
import soak_programs
import soak_report
from soak_programs import Sample


def test_schedule_has_every_event_of_a_day_in_order():
    events = soak_day.schedule(soak_day.MINUTES_PER_DAY, 1)
    assert events == sorted(events, key=lambda event: event.at_s)
    counts = {kind: sum(event.kind == kind for event in events) for kind in soak_day.PER_DAY}
    expected = {k: 0 if k in soak_day.COUNTED else n for k, n in soak_day.PER_DAY.items()}
    assert counts == expected
    assert soak_day.schedule(5.0, 1) == soak_day.schedule(5.0, 1) != soak_day.schedule(5.0, 2)


def test_short_schedule_has_every_kind_of_event():
    kinds = {event.kind for event in soak_day.schedule(0.3, 1)}
    assert kinds == {*soak_day.PER_DAY} - {*soak_day.COUNTED}


@pytest.mark.parametrize("minutes", [0.3, 5.0, 50.0])
def test_programs_are_restarted_only_in_the_first_part(minutes):
    """The remaining time is long enough to measure the slope of their memory."""
    events = soak_day.schedule(minutes, 1)
    last_s = max(event.at_s for event in events if event.kind in soak_day.RESTARTING)
    assert last_s <= 60.0 * minutes * soak_day.RESTARTING_SHARE
    assert {*soak_day.RESTARTING} < {*soak_day.PER_DAY}


def test_simulated_hours_are_those_of_the_event_that_is_furthest_behind():
    counts = dict(soak_day.PER_DAY)
    assert soak_day.simulated_hours(counts)[0] == soak_day.DAY_HOURS
    assert soak_day.simulated_hours({**counts, "full disk": 1}) == (soak_day.DAY_HOURS / 2, "full disk")
    assert soak_day.simulated_hours({})[0] == 0.0


def test_slope_ignores_warm_up_and_restarts():
    """There are two processes that start at different levels and grow by 0.01 MB per second."""
    samples = [
        Sample(at, life, 100.0 * life + 0.01 * at + (500.0 if at - begin < 350 else 0.0), 9, 9, 30 * at)
        for life, begin in ((1, 0), (2, 700))
        for at in range(begin, begin + 600)
    ]
    fitted, error = soak_report.slope(samples, "rss_mb")
    assert fitted == pytest.approx(0.01, rel=1e-6) and error < 1e-6
    assert soak_report.slope(samples[:400], "rss_mb") is None


def test_warm_up_of_a_slow_machine_is_not_over_after_some_minutes():
    """The memory grows until 10,000 frames are published, which takes 1,000 s at ten frames per second."""
    samples = [Sample(at, 1, min(0.002 * at, 2.0), 9, 9, 10 * at) for at in range(1500)]
    fitted, _ = soak_report.slope(samples, "rss_mb")
    assert fitted == pytest.approx(0.0, abs=1e-9)
    assert soak_report.slope(samples[:1000], "rss_mb") is None


def test_error_of_a_slope_covers_memory_that_wanders_without_growing():
    """Memory changes in steps. The slopes of 40 random walks around a level must be within three errors of
    zero.
    """
    random = np.random.default_rng(1)
    shares = []
    for _ in range(40):
        levels = np.zeros(60)
        for k in range(1, 60):
            levels[k] = 0.7 * levels[k - 1] + random.normal()
        samples = [
            Sample(at, 1, levels[(at - 360) // 10] if at >= 360 else 0.0, 9, 9, 30 * at) for at in range(960)
        ]
        fitted, error = soak_report.slope(samples, "rss_mb")
        shares.append(abs(fitted) / error)
    assert sum(share > 3.0 for share in shares) <= 1 and np.median(shares) < 1.2


@pytest.mark.parametrize(
    ("line", "counts"),
    [
        ('{"level": "error", "message": "internal error"}', True),
        ('{"level": "warning", "message": "an error is mentioned"}', False),
        ("Traceback (most recent call last):", True),
        ("Fatal Python error: Segmentation fault", True),
        ("17", False),
    ],
)
def test_errors_are_recognised_in_logs(line, counts):
    assert soak_programs.is_error(line) is counts


def test_only_kills_and_freezes_of_the_soak_are_expected():
    """One kill and one freeze were caused by the soak. A second one, or any other cause, is a fault."""
    program = soak_programs.Program("edge", [], "edge", expected_freezes=1)
    sleeper = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    program.kill()
    program.take_pid(sleeper.pid)
    assert sleeper.wait(10.0) == -signal.SIGKILL
    causes = [soak_programs.KILL_CAUSE, "no progress for 10 s"]
    program.restarts = [(0.0, cause) for cause in causes]
    assert program.unexpected_ends == []
    program.restarts = [(0.0, cause) for cause in [*causes, "exit code 1", *causes]]
    assert program.unexpected_ends == ["exit code 1", *causes]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the soak measures by /proc")
@pytest.mark.skipif(not (os.environ.get("DISPLAY") or soak.shutil.which("Xvfb")), reason="needs a display")
def test_short_soak_survives_every_event(tmp_path):
    report = soak.soak(0.3, 3, tmp_path, round_s=4.0)
    assert report["faults"] == []
    kinds = {*soak_day.PER_DAY} - {*soak_day.COUNTED}
    assert kinds <= report["counts"].keys()
    assert report["published"]["bodies"] > 10
    for name in ("edge", "viewer", "health page"):
        reasons = [each["reason"] for each in report["programs"][name]["restarts"]]
        # The hanging driver may hang long enough for another restart. Any other cause is listed as a fault.
        assert reasons.count(soak_programs.KILL_CAUSE) == 1 and len(reasons) <= 2
        assert report["programs"][name]["lives"] == 1 + len(reasons)
    assert report["limited_by"] in (tmp_path / "report.md").read_text()
