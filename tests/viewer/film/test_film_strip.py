"""Tests that a film is encoded in the background with all images in order and upright, and that errors are
reported.
"""

import threading

import av
import numpy as np
import pytest

from enliven import cli
from enliven.commands import run as run_command
from enliven.film.writer import FilmWriter
from enliven_viewer.film.film_strip import MAX_QUEUED_IMAGES, FilmStrip
from enliven_viewer.film.sheet import Tiles
from enliven_viewer.render.gl.targets import flip_rows


def raw(level: int) -> np.ndarray:
    """Returns a (32, 64, 4) image in OpenGL's row order. The upper half has brightness ``level``, the lower
    half is black.
    """
    picture = np.zeros((32, 64, 4), np.uint8)
    picture[16:] = level
    return picture


def test_upright_turns_the_rows_and_drops_the_fourth_channel():
    picture = flip_rows(raw(200))
    assert picture.shape == (32, 64, 3) and picture.flags.c_contiguous
    assert (picture[:16] == 200).all() and (picture[16:] == 0).all()


def test_every_picture_is_in_the_film_and_on_the_sheet_in_order(tmp_path):
    tiles = Tiles(3, 64)
    levels = list(range(10, 250, 10))
    with FilmWriter(tmp_path / "made.mp4", (64, 32), 30, 1) as writer, FilmStrip(writer, tiles) as strip:
        for n, level in enumerate(levels):
            strip.add(n / 30, raw(level))
    with av.open(str(tmp_path / "made.mp4")) as film:
        shown = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(shown) == writer.count == len(levels)
    np.testing.assert_allclose([picture[4:12].mean() for picture in shown], levels, atol=12)
    assert [round(30 * tile.seconds) for tile in tiles.choose_tiles()] == sorted(
        round(30 * tile.seconds) for tile in tiles.choose_tiles()
    )
    assert tiles.choose_tiles()[0].seconds == 0.0


class Full:
    """A buffer for images that is full after the second one."""

    def __init__(self) -> None:
        self.count, self.threads = 0, set()

    def add(self, picture) -> None:
        self.threads.add(threading.current_thread().name)
        self.count += 1
        if self.count > 2:
            raise OSError("no space left")


def test_encoder_errors_are_raised():
    full = Full()
    with pytest.raises(OSError, match="no space left"), FilmStrip(full, Tiles(3, 64)) as strip:
        for n in range(3 + 2 * MAX_QUEUED_IMAGES):
            strip.add(n / 30, raw(n))
    assert full.threads != {threading.current_thread().name}


def test_an_error_at_the_very_end_is_raised_too():
    with pytest.raises(OSError, match="no space left"), FilmStrip(Full(), Tiles(3, 64)) as strip:
        for n in range(3):
            strip.add(n / 30, raw(n))


def test_a_film_s_viewer_starts_with_its_edge_and_waits_for_it(monkeypatch, tmp_path):
    started = []

    def together(processes) -> int:
        started.extend(processes)
        return 0

    monkeypatch.setattr(run_command, "run_together", together)
    words = ["run", "--seconds", "0.1", "--out", str(tmp_path)]
    assert cli.run([*words, "--film"]) == 0
    edge, viewer = started
    assert edge.ready() and "--wait" in viewer.arguments
    started.clear()
    assert cli.run([*words, "--window", "--sensor", "synthetic", "--set", "width=80"]) == 0
    assert not started[0].ready() and "--wait" not in started[1].arguments
    at = started[0].arguments.index("--set")
    assert started[0].arguments[at + 1] == "width=80"
