"""Tests of sounds for a performance: read from files, mixed, played in sync, saved, and undone."""

from __future__ import annotations

import wave
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.document.project import are_identical
from enliven.errors import InputError
from enliven.formats.project.file import parse_project, project_bytes
from enliven.sounds import SOUND_RATE, Sound, mix_sounds
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.sound.player import SoundPlayer
from enliven_viewer.studio.features.sound.sound_reader import read_sound
from enliven_viewer.studio.features.sound.waveform import compute_envelope
from enliven_viewer.studio.workspace.workspace import Workspace

BEAT = 0.25
"""Time of the click in the written file, seconds."""


def written(path: Path, rate: int = 44_100, channels: int = 2) -> Path:
    """Writes a second of silence with one click."""
    samples = np.zeros((rate, channels), np.int16)
    samples[round(BEAT * rate) : round(BEAT * rate) + rate // 100] = 20_000
    with wave.open(str(path), "wb") as file:
        file.setparams((channels, 2, rate, 0, "NONE", ""))
        file.writeframes(samples.tobytes())
    return path


@pytest.mark.parametrize(("rate", "channels"), [(44_100, 2), (48_000, 1), (8_000, 1)])
def test_a_file_is_read_at_one_rate_and_clicks_when_it_did(tmp_path, rate, channels) -> None:
    sound = read_sound(written(tmp_path / "beat.wav", rate, channels))
    assert sound.id == "beat" and len(sound.samples) == pytest.approx(SOUND_RATE, abs=40)
    first = np.flatnonzero(np.abs(sound.samples.astype(int)) > 5_000)[0]
    assert first / SOUND_RATE == pytest.approx(BEAT, abs=0.003)


def test_invalid_sound_is_refused_and_truncated_sound_is_read(tmp_path) -> None:
    (tmp_path / "no.wav").write_bytes(b"no sound at all")
    with pytest.raises(InputError, match="cannot be read as sound"):
        read_sound(tmp_path / "no.wav")
    with pytest.raises(InputError):
        read_sound(tmp_path / "missing.mp3")
    whole = written(tmp_path / "whole.wav").read_bytes()
    (tmp_path / "half.wav").write_bytes(whole[: len(whole) // 2])
    assert len(read_sound(tmp_path / "half.wav").samples) == pytest.approx(SOUND_RATE / 2, rel=0.1)


def noise(begin: float, count: int = 400, seed: int = 0) -> Sound:
    loud = np.random.default_rng(seed).integers(-30_000, 30_000, count)
    return Sound(f"noise {seed}", loud.astype(np.int16), begin)


@given(st.integers(-300, 900), st.integers(1, 500), st.integers(0, 300), st.integers(0, 300))
def test_parts_of_a_mix_are_the_mix(first, count, one, other) -> None:
    sounds = [noise(one / SOUND_RATE), noise(other / SOUND_RATE, seed=1)]
    whole = mix_sounds(sounds, -300, 2000)
    np.testing.assert_array_equal(mix_sounds(sounds, first, count), whole[first + 300 : first + 300 + count])
    loud = np.zeros(2000, np.int64)
    for sound in sounds:
        begin = 300 + round(sound.begin * SOUND_RATE)
        loud[begin : begin + 400] += sound.samples
    np.testing.assert_array_equal(whole, loud.clip(-32_768, 32_767))


def test_the_picture_of_a_sound_is_its_loudest_samples() -> None:
    sound = noise(0.5, SOUND_RATE // 2)
    loud = compute_envelope(sound, 0.0, 2.0, 8)
    assert (loud[[0, 1, 4, 5, 6, 7]] == 0).all()
    half = np.abs(sound.samples.astype(int)).reshape(2, -1).max(1) / 32_767
    np.testing.assert_allclose(loud[2:4], half, rtol=1e-6)


class Device:
    """A sound card that asks for samples."""

    latency = 0.05

    def __init__(self, fill) -> None:
        self.fill, self.closed = fill, False

    def ask(self, seconds: float) -> np.ndarray:
        out = np.zeros((round(seconds * SOUND_RATE), 1), np.int16)
        self.fill(out, len(out), None, None)
        return out[:, 0]

    def close(self) -> None:
        self.closed = True


def test_sound_follows_the_playhead_and_plays_only_with_it() -> None:
    devices: list[Device] = []
    editor = Editor()
    player = SoundPlayer(editor, lambda fill: devices.append(Device(fill)) or devices[-1])
    sound = noise(0.0, 3 * SOUND_RATE)
    editor.edit("sound", lambda project: project.with_sounds(sound))
    assert editor.length >= 3.0, "a project lasts as long as its sound"
    player.synchronise()
    assert not devices
    editor.time, editor.playing = 1.0, True
    player.synchronise()
    begun = round((1.0 + Device.latency) * SOUND_RATE)
    np.testing.assert_array_equal(devices[0].ask(0.1), sound.samples[SOUND_RATE : SOUND_RATE + 3200])
    editor.time = 1.06
    player.synchronise()
    np.testing.assert_array_equal(devices[0].ask(0.01), sound.samples[SOUND_RATE + 3200 :][:320])
    editor.time = 2.0  # the playhead was dragged
    player.synchronise()
    there = begun + SOUND_RATE
    np.testing.assert_array_equal(devices[0].ask(0.01), sound.samples[there : there + 320])
    player.toggle()
    player.synchronise()
    assert devices[0].closed and len(devices) == 1


def test_missing_sound_device_is_reported_once_and_playback_continues(tmp_path) -> None:
    tried: list[int] = []

    def none(fill):
        tried.append(1)
        raise OSError("PortAudio library not found")

    editor = Editor()
    player = SoundPlayer(editor, none)
    editor.edit("sound", lambda project: project.with_sounds(noise(0.0)))
    editor.playing = True
    for _ in range(5):
        player.synchronise()
    assert len(tried) == 1 and editor.playing
    assert [toast.text for toast in editor.toasts.shown] == [
        "The sound cannot be played here (PortAudio library not found)"
    ]


def test_sound_opens_at_the_playhead_is_saved_and_undone(tmp_path) -> None:
    workspace = Workspace.new(Editor(), tmp_path)
    editor = workspace.editor
    before = editor.project
    editor.scrub(1.5)
    workspace.open(written(tmp_path / "song.wav"))
    assert editor.project.sounds["song"].begin == pytest.approx(1.5)
    again = parse_project(project_bytes(editor.project))
    assert are_identical(again.sounds["song"].samples, editor.project.sounds["song"].samples)
    editor.scrub(0.5)
    workspace.actions.do("sound.begin")
    assert editor.project.sounds["song"].begin == pytest.approx(0.5)
    workspace.actions.do("sound.remove")
    assert not editor.project.sounds and not workspace.actions.do("sound.begin")
    for _ in range(3):
        editor.undo()
    assert are_identical(editor.project, before)


def test_samples_of_another_type_are_refused() -> None:
    for samples, begin in (
        (np.zeros(4), 0.0),
        (np.zeros((2, 2), np.int16), 0.0),
        (np.zeros(4, np.int16), -1.0),
    ):
        with pytest.raises(InputError, match="the samples or the start time of the sound are not valid"):
            Sound("x", samples, begin)
