"""The exporter of .mp4: a film of the performances that it is given, and refusals before any work."""

import av
import numpy as np
import pytest

from enliven.document import Clip, Skeleton
from enliven.errors import InputError
from enliven.exporters import exporter_of, performance_of_clip
from enliven.rotation import from_rotation_vector


def test_a_film_is_as_long_as_the_performance_and_shows_it_move(tmp_path) -> None:
    at = np.array([[0.0, 0, 0], [0, 1, 0], [0.5, 1, 0]])
    turns = from_rotation_vector(np.linspace(0, 1, 10)[:, None, None] * np.array([0.0, 0, 1.0]))
    clip = Clip(
        "arm",
        Skeleton(("a", "b", "c"), np.array([-1, 0, 1]), at),
        turns.repeat(3, 1),
        0 * at[:1].repeat(10, 0),
        0.05,
    )
    path = tmp_path / "arm.mp4"
    exporter_of(path, size="160x90").write(path, [performance_of_clip(clip)], "arm", size="160x90")
    with av.open(str(path)) as film:
        pictures = [frame.to_ndarray(format="rgb24").astype(int) for frame in film.decode(video=0)]
    assert len(pictures) == 14 and pictures[0].shape == (90, 160, 3)
    assert np.abs(pictures[0] - pictures[-1]).max() > 60


def test_a_size_that_is_none_is_refused_before_any_work(tmp_path) -> None:
    with pytest.raises(InputError, match="'wide' is no size"):
        exporter_of(tmp_path / "a.mp4", size="wide")
    with pytest.raises(InputError, match="has no 'unit'"):
        exporter_of(tmp_path / "a.mp4", unit="cm")
