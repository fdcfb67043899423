"""Tests of the .mp4 exporter: a film of given performances, and errors that are raised before any work."""

from pathlib import Path

import av
import numpy as np
import pytest

from enliven.commands.export import export
from enliven.document import Clip, Project, Skeleton, still_shape
from enliven.errors import InputError
from enliven.exporters import exporter_of, performance_of_clip
from enliven.formats.project.file import write_project
from enliven.rotation import from_rotation_vector
from enliven.sounds import SOUND_RATE, Sound
from enliven_viewer.studio.features.sound.sound_reader import read_sound


def waving() -> Clip:
    """Returns half a second of a waving arm."""
    at = np.array([[0.0, 0, 0], [0, 1, 0], [0.5, 1, 0]])
    turns = from_rotation_vector(np.linspace(0, 1, 10)[:, None, None] * np.array([0.0, 0, 1.0]))
    skeleton = Skeleton(("a", "b", "c"), np.array([-1, 0, 1]), at)
    return Clip("arm", skeleton, turns.repeat(3, 1), 0 * at[:1].repeat(10, 0), 0.05)


def test_a_film_is_as_long_as_the_performance_and_shows_it_move(tmp_path) -> None:
    path = tmp_path / "arm.mp4"
    exporter_of(path, size="160x90").write(path, [performance_of_clip(waving())], "arm", size="160x90")
    with av.open(str(path)) as film:
        pictures = [frame.to_ndarray(format="rgb24").astype(int) for frame in film.decode(video=0)]
        assert not film.streams.audio, "it was not performed along a sound"
    assert len(pictures) == 14 and pictures[0].shape == (90, 160, 3)
    assert np.abs(pictures[0] - pictures[-1]).max() > 60


CODED = 0.035
"""Maximum offset of a sound in a film in seconds, because the encoder's blocks have 1,024 samples."""


def click_at(path: Path) -> float:
    """Returns the second at which a film clicks. Checks that its sound ends with its images."""
    heard = read_sound(path).samples
    with av.open(str(path)) as film:
        lasts = float(film.streams.video[0].duration * film.streams.video[0].time_base)
    assert len(heard) / SOUND_RATE == pytest.approx(lasts, abs=2 * CODED)
    return float(np.flatnonzero(np.abs(heard.astype(int)) > 5_000)[0] / SOUND_RATE)


@pytest.mark.parametrize(("start", "clicks"), [(0.0, 0.3), (0.2, 0.1)])
def test_the_film_of_a_project_has_its_sound_from_its_first_picture_on(start, clicks, tmp_path) -> None:
    """This also holds for a part of the project. The sound is longer than the images, and is cut with
    them.
    """
    samples = np.zeros(2 * SOUND_RATE, np.int16)
    samples[round(0.1 * SOUND_RATE) :][:400] = 25_000
    clip = waving()
    shape = still_shape("arm", clip.skeleton)
    project = Project().with_takes(clip).with_characters(shape).with_sounds(Sound("beat", samples, 0.2))
    write_project(tmp_path / "show.enliven", project)
    film_path = tmp_path / "show.mp4"
    export(tmp_path / "show.enliven", film_path, ["arm"], start=start, size="160x90")
    assert click_at(film_path) == pytest.approx(clicks, abs=CODED)


def test_missing_sound_encoder_gives_silent_film_and_warning(tmp_path, monkeypatch, caplog) -> None:
    monkeypatch.setattr("enliven.film.writer._SOUND_CODEC", "no such encoder")
    path = tmp_path / "arm.mp4"
    loud = np.full(SOUND_RATE, 9_000, np.int16)
    exporter_of(path).write(path, [performance_of_clip(waving())], "arm", size="160x90", sound=loud)
    assert "no sound encoder" in caplog.text
    with av.open(str(path)) as film:
        assert not film.streams.audio and sum(1 for _ in film.decode(video=0)) == 14


def test_a_size_that_is_none_is_refused_before_any_work(tmp_path) -> None:
    with pytest.raises(InputError, match="'wide' is not a size"):
        exporter_of(tmp_path / "a.mp4", size="wide")
    with pytest.raises(InputError, match=r"the format \.mp4 does not support the option 'unit'"):
        exporter_of(tmp_path / "a.mp4", unit="cm")
