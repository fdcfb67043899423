"""Stiff and soft spots."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.deformation.graph.stiffness import stiffness_at
from enliven.errors import InputError


def test_without_spots_there_is_nothing_to_say():
    assert stiffness_at(np.zeros((3, 3)), ()) is None


@given(st.floats(0.01, 100.0), st.floats(0.05, 3.0), st.integers(0, 2**32 - 1))
def test_a_spot_has_its_factor_in_the_middle_and_ends_at_its_radius(factor, radius, seed):
    rng = np.random.default_rng(seed)
    middle = rng.normal(size=3)
    ways = rng.normal(size=(50, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    far = np.sort(rng.random(50)) * 2 * radius
    out = stiffness_at(np.vstack([middle, middle + ways * far[:, None]]), ((*middle, radius, factor),))
    assert out[0] == pytest.approx(factor)
    np.testing.assert_allclose(out[1:][far >= radius], 1.0)
    # It only ever eases towards 1 on the way out.
    assert (np.diff(np.abs(np.log(out))) <= 1e-9).all()


def test_spots_that_overlap_multiply():
    here = np.zeros((1, 3))
    both = stiffness_at(here, ((0, 0, 0, 1, 4.0), (0, 0, 0, 2, 0.5)))
    assert both[0] == pytest.approx(2.0)


@pytest.mark.parametrize(
    "spot", [(0, 0, 0, 0, 2), (0, 0, 0, 1, 0), (0, 0, np.nan, 1, 2), (0, 0, 0, 1, np.inf)]
)
def test_a_spot_that_makes_no_sense_is_refused(spot):
    with pytest.raises(InputError, match="spot 1"):
        stiffness_at(np.zeros((2, 3)), (spot,))
