"""Tests that a device's reports become health states, which end when the device recovers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.camera import world_from_level_camera
from enliven.health import HealthKind
from enliven_edge.sensors.base import Condition
from enliven_edge.tracking.health.alarm import Alarms
from enliven_edge.tracking.health.device_health import check_condition

SECOND = 1_000_000_000
DOWN = (0.0, 9.81, 0.0)
LEVEL = world_from_level_camera(1.2)


def kinds_after(
    conditions: list[Condition], stand=LEVEL, floor_known=True, seconds: int = 20
) -> list[set[str]]:
    """Returns the problems at the end of each condition. Each condition lasts ``seconds``."""
    alarms, reported, now = Alarms("The sensor"), [], 0
    for condition in conditions:
        for _ in range(seconds):
            now += SECOND
            check_condition(alarms, condition, stand, floor_known, now)
        reported.append({state.kind for state in alarms.states})
    return reported


@pytest.mark.parametrize(
    ("ill", "kind", "words"),
    [
        (Condition("USB 2", slow_link=True), HealthKind.SLOW_LINK, "only a USB 2 connection"),
        (Condition(calibrated=False), HealthKind.NOT_CALIBRATED, "does not report its lens"),
        (Condition(temperature=92.0, hot=95.0), HealthKind.HOT, "92 degrees, and stops at 95"),
        (Condition(gravity=(0.1, -9.7, 0.3)), HealthKind.UPSIDE_DOWN, "the other way up"),
    ],
)
def test_problem_is_reported_until_it_is_solved(ill, kind, words):
    well = Condition("USB 3", temperature=50.0, hot=95.0, gravity=DOWN)
    assert kinds_after([well, ill, well], floor_known=False) == [set(), {kind}, set()]
    alarms = Alarms("The sensor")
    for second in range(20):
        check_condition(alarms, ill, LEVEL, True, second * SECOND)
    assert words in alarms.states[0].what and alarms.states[0].remedy


@given(
    tilt=st.floats(-0.6, 0.6),
    roll=st.floats(-0.3, 0.3),
    error=st.floats(0.0, 30.0).filter(lambda degrees: not 4.0 < degrees < 6.1),
    length=st.floats(0.1, 20.0),
)
def test_floor_and_accelerometer_are_compared_wherever_the_sensor_looks(tilt, roll, error, length):
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]]
    stand = world_from_level_camera(1.2, tilt) @ turn
    down = stand[:3, :3].T @ (0.0, -1.0, 0.0)
    aside = np.cross(down, (0.0, 0.0, 1.0))
    aside /= np.linalg.norm(aside)
    felt = length * (np.cos(np.radians(error)) * down + np.sin(np.radians(error)) * aside)
    reported = kinds_after([Condition(gravity=tuple(felt))], stand, seconds=5)[0]
    assert (HealthKind.NOT_LEVEL in reported) == (error > 6.0)


def test_a_sensor_that_is_meant_to_hang_upside_down_may():
    over = LEVEL @ np.diag([-1.0, -1.0, 1.0, 1.0])
    assert kinds_after([Condition(gravity=(0.0, -9.8, 0.0))], over) == [set()]
    assert HealthKind.UPSIDE_DOWN in kinds_after([Condition(gravity=DOWN)], over)[0]


@pytest.mark.parametrize("gravity", [None, (0.0, 0.0, 0.0), (np.nan, 1.0, 0.0), (np.inf, 0.0, 0.0)])
def test_invalid_accelerometer_reading_is_ignored(gravity):
    assert kinds_after([Condition(gravity=gravity)]) == [set()]
