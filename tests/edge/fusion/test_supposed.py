"""Tests that a body that is only predicted by one sensor has no effect while another sensor sees the
person.
"""

import numpy as np
from test_fuser import STANDING, body, run, shifted

WALK = 0.25
"""Walking speed in metres per second, so that the prediction of the occluded sensor falls behind."""
COVERED = (1.0, 4.0)


def supposing(name, time):
    """Returns frames in which sensor b sees a person walk, while sensor a is covered and keeps the last
    position.
    """
    here = shifted(WALK * time)
    if name == "a" and COVERED[0] <= time < COVERED[1]:
        return [body(shifted(WALK * COVERED[0]), 1, sure=0.0)]
    return [body(here, 1)]


def test_predicted_body_keeps_its_identity():
    fused = [(time, bodies) for time, bodies, _ in run(supposing, 6.0) if time > 0.3]
    assert {tuple(b.id for b in bodies) for _, bodies in fused} == {(1,)}
    assert max(abs(b.joints[0, 0] - shifted(WALK * t)[0, 0]) for t, bodies in fused for b in bodies) < 0.05


def test_return_from_a_predicted_position_has_no_velocity():
    """The first frame after the occlusion shows neither motion at 20 m/s nor a new person."""
    *_, (_, _, fuser) = run(supposing, COVERED[1] + 0.02)
    sighting = fuser.views[0].sightings[1]
    assert np.array_equal(sighting.velocity, np.zeros((20, 3)))
    assert sighting.person == 1


def test_person_hidden_from_all_sensors_is_still_predicted():
    """Both sensors are covered. The known person is still predicted, with zero confidence."""

    def told(name, time):
        return [body(STANDING, 1, sure=1.0 if time < 1.0 else 0.0)]

    *_, (_, bodies, _) = run(told, 2.0)
    assert [b.id for b in bodies] == [1]
    assert bodies[0].confidence.max() < 0.1
