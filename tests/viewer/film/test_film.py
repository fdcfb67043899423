"""Tests that a short film has the correct length, size and content, and that a contact sheet has its
tiles.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import get_args

import av
import numpy as np
import pytest
from PIL import Image
from rich.console import Console

from enliven.document.character import Character, Pose
from enliven.errors import InputError, ResourceError
from enliven.film.encoders import AUTO, ENCODERS, FilmEncoder, choose_encoder
from enliven.film.writer import FilmWriter
from enliven.settings import load_settings
from enliven_viewer.film.film import make_film
from enliven_viewer.film.sheet import Tiles, write_sheet
from enliven_viewer.playback.document import Document, EdgeState
from enliven_viewer.playback.timeline import NS_PER_S, CueFrame, Timeline
from enliven_viewer.settings import Encoder, FilmSettings, RenderSettings, ViewerSettings

PROFILES = Path(__file__).parents[3] / "firmware_configs"
SMALL = ViewerSettings(
    render=RenderSettings(shadow_size=64, contact_size=32, samples=1),
    film=FilmSettings(columns=3, rows=2, tile_width=80, patience=0.2),
    width=160,
    height=90,
)


class Walk:
    """A feed of a box that moves along +X, with messages in bursts, and then ends."""

    def __init__(self, character: Character, count: int, rate: float = 30.0, start: int = 10**15) -> None:
        self.character, self.count, self.step = character, count, round(NS_PER_S / rate)
        self.start, self.sent = start, 0

    def poll(self, document: Document) -> int:
        document.characters = {self.character.id: self.character}
        ended = self.sent >= self.count
        document.edge = EdgeState(True, "here", "ended" if ended else "tracking")
        burst = min(7, self.count - self.sent)
        for _ in range(burst):
            rest = self.character.rest_pose(self.start + self.sent * self.step)
            shift = np.array([2.0 * self.sent * self.step / NS_PER_S, 0, 0], np.float32)
            document.add_pose(Pose(rest.character, rest.time_ns, rest.linear, rest.positions + shift))
            if self.sent == 10:
                document.set_cues(
                    CueFrame(self.character.id, np.array([0], np.int32), np.ones(1, np.float32))
                )
            self.sent += 1
        return burst

    def ask(self, order, then=None) -> None: ...

    def close(self) -> None: ...


class Vanishing(Walk):
    """A feed of a killed edge, which becomes silent without a final message."""

    def poll(self, document: Document) -> int:
        arrived = super().poll(document)
        document.edge = EdgeState(arrived > 0, "here", "tracking")
        return arrived


class Silence(Walk):
    """A feed without any messages."""

    def poll(self, document: Document) -> int:
        document.edge = EdgeState(False, "tcp://127.0.0.1:9")
        return 0


def filmed(feed: Walk, film: Path | None, sheet: Path | None = None, seconds: float | None = None):
    console = Console(quiet=True)
    document = Document(Timeline(bounded=False))
    return make_film(feed, document, film, sheet, SMALL, seconds=seconds, console=console)


def decoded(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as file:
        return [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]


def test_a_film_has_a_picture_for_every_thirtieth_second(gl, box, tmp_path) -> None:
    film = filmed(Walk(box, 25), tmp_path / "deep" / "film.mp4", tmp_path / "sheet.png")
    pictures = decoded(tmp_path / "deep" / "film.mp4")
    assert film.pictures == len(pictures) == 25
    assert all(p.shape == (90, 160, 3) for p in pictures)
    assert np.mean([p.std() for p in pictures]) > 30
    with av.open(str(tmp_path / "deep" / "film.mp4")) as file:
        stream = file.streams.video[0]
        assert stream.average_rate == 30 and stream.codec_context.pix_fmt == "yuv420p"
        assert film.codec == "mpeg4" or stream.codec_context.name == "h264"
    assert Image.open(tmp_path / "sheet.png").width == 3 * 80 + 4 * 10


@pytest.mark.parametrize("rate", [12.0, 30.0, 90.0])
def test_a_film_is_as_long_as_its_sensor_time(gl, box, tmp_path, rate) -> None:
    film = filmed(Walk(box, round(rate) + 1, rate), tmp_path / "film.mp4")
    assert abs(film.pictures - 31) <= 1


def test_film_stops_at_the_requested_time(gl, box, tmp_path) -> None:
    assert filmed(Walk(box, 60), tmp_path / "film.mp4", seconds=0.5).pictures == 15


def test_the_film_follows_what_walks_away(gl, box, tmp_path) -> None:
    filmed(Walk(box, 60), tmp_path / "film.mp4")
    first, *_, last = decoded(tmp_path / "film.mp4")
    clay = [(p[..., 0].astype(int) - p[..., 2] > 40).mean() for p in (first, last)]
    assert min(clay) > 0.02


def test_memory_is_released_while_filming(gl, box, tmp_path) -> None:
    feed, document = Walk(box, 60), Document(Timeline(bounded=False))
    make_film(feed, document, tmp_path / "film.mp4", None, SMALL, console=Console(quiet=True))
    assert len(document.timeline) <= 8


def test_missing_edge_is_reported_and_leaves_no_file(gl, box, tmp_path) -> None:
    with pytest.raises(ResourceError, match=r"no edge appeared.*enliven edge"):
        filmed(Silence(box, 0), tmp_path / "film.mp4")
    assert not (tmp_path / "film.mp4").exists()


def test_an_edge_that_is_killed_ends_the_film(gl, box, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("enliven_viewer.film.film._SILENCE_TIMEOUT_S", 0.2)
    assert filmed(Vanishing(box, 12), tmp_path / "film.mp4").pictures == 12
    assert len(decoded(tmp_path / "film.mp4")) == 12


def test_edge_without_a_pose_is_reported(gl, box, tmp_path) -> None:
    with pytest.raises(ResourceError, match="sent no pose"):
        filmed(Walk(box, 0), tmp_path / "film.mp4")


def test_unwritable_film_path_is_reported(gl, box, tmp_path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ResourceError, match="cannot be written"):
        filmed(Walk(box, 5), tmp_path / "file" / "film.mp4")


def test_an_odd_size_becomes_even(tmp_path) -> None:
    with FilmWriter(tmp_path / "odd.mp4", (65, 33), 30, 1) as writer:
        writer.add(np.zeros((33, 65, 3), np.uint8))
    assert decoded(tmp_path / "odd.mp4")[0].shape == (32, 64, 3)


@pytest.mark.parametrize("name", ["libvpx-vp9", "mpeg4"])
def test_film_without_h264_uses_another_codec_and_reports_it(name, tmp_path, monkeypatch, caplog) -> None:
    only = tuple(encoder for encoder in ENCODERS if encoder.name == name)
    monkeypatch.setattr("enliven.film.encoders.ENCODERS", only)
    with FilmWriter(tmp_path / "old.mp4", (64, 32), 30, 1) as writer:
        writer.add(np.full((32, 64, 3), 200, np.uint8))
    assert (
        f"no H.264 encoder was found, so {tmp_path / 'old.mp4'} is encoded as {only[0].format}" in caplog.text
    )
    assert abs(decoded(tmp_path / "old.mp4")[0].mean() - 200) < 8


def test_missing_encoders_are_reported(monkeypatch) -> None:
    monkeypatch.setattr("enliven.film.encoders.ENCODERS", ())
    with pytest.raises(ResourceError, match="no film encoder"):
        choose_encoder(av)


def test_an_encoder_that_is_listed_but_does_not_open_is_passed_over(tmp_path, monkeypatch) -> None:
    """PyAV lists hardware encoders on every machine, but this machine has no such device."""
    broken = FilmEncoder("h264_v4l2m2m", "H.264", "the system's own")
    if broken.name not in av.codecs_available:
        pytest.skip(f"this build of PyAV does not list {broken.name}")
    monkeypatch.setattr("enliven.film.encoders.ENCODERS", (broken, *ENCODERS))
    with FilmWriter(tmp_path / "film.mp4", (64, 32), 30, 1) as writer:
        writer.add(np.zeros((32, 64, 3), np.uint8))
    assert writer.codec != broken.name and len(decoded(tmp_path / "film.mp4")) == 1
    with pytest.raises(ResourceError, match="h264_v4l2m2m is not available"):
        FilmWriter(tmp_path / "none.mp4", (64, 32), 30, 1, broken.name)
    assert not (tmp_path / "none.mp4").exists()


def test_the_profile_of_an_image_films_without_gpl(gl, box, tmp_path, caplog) -> None:
    profile = load_settings(ViewerSettings, PROFILES / "viewers" / "image.toml")
    settings = replace(SMALL, film=replace(SMALL.film, encoder=profile.film.encoder))
    document = Document(Timeline(bounded=False))
    film = make_film(
        Walk(box, 5), document, tmp_path / "film.mp4", None, settings, console=Console(quiet=True)
    )
    licences = {encoder.name: encoder.licence for encoder in ENCODERS}
    assert not licences[film.codec].startswith("GPL") and len(decoded(tmp_path / "film.mp4")) == 5
    assert not caplog.text


def test_the_setting_knows_every_encoder() -> None:
    assert set(get_args(Encoder)) == {AUTO} | {encoder.name for encoder in ENCODERS}
    with pytest.raises(InputError, match="encoder"):
        load_settings(ViewerSettings, {"film": {"encoder": "libx265"}})


@pytest.mark.parametrize("count", [1, 2, 5, 6, 23, 200])
def test_tiles_are_spread_over_the_whole_film(count: int) -> None:
    tiles = Tiles(6, 16)
    for k in range(count):
        tiles.add(k / 30, np.full((9, 16, 3), k % 256, np.uint8))
    seconds = [tile.seconds for tile in tiles.choose_tiles()]
    assert len(seconds) == min(count, 6) and seconds == sorted(set(seconds))
    assert seconds[0] == 0 and seconds[-1] >= 0.8 * (count - 1) / 30


def test_a_sheet_without_pictures_is_not_written(tmp_path) -> None:
    write_sheet(tmp_path / "none.png", [], 4, "title", "")
    assert not (tmp_path / "none.png").exists()
