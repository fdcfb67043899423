"""Tests a session in the real window with the real edge: scanning, voice, possession, physics, recording."""

from __future__ import annotations

import importlib.util
import math
import os
import shutil
import subprocess
import wave
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from in_a_window import in_a_window
from scipy.signal import resample_poly

from enliven.recording import Recorder, Recording
from enliven.samples.shipped import load_sample
from enliven_edge.doctor import find_shipped_recording
from enliven_synthesis.sensor.handheld import HandheldPath, HandheldScan
from enliven_synthesis.sensor.profile import load_profile

SESSION = Path(__file__).parents[1] / "sitting_session.py"
PATH = HandheldPath(target=(0.0, 0.45, 0.0), radius=1.3, height=(0.7, 1.3), turns=1.0, seconds=8.0)
STEP = 5
ROUNDS = 5
RATE = 16000
MINUTES = 5
SETTINGS = """[controls.voice]
kind = "voice"
wav = "say.wav"
[controls.voice.map]
"puppet follow my pose" = "follow"
"puppet show another" = "next"
"""


def speech(text: str, folder: Path) -> np.ndarray:
    """Returns a sentence from a speech synthesiser, at 16 kHz."""
    path = folder / "sentence.wav"
    subprocess.run(["espeak-ng", "-v", "en-us", "-s", "140", "-w", str(path), text], check=True)
    with wave.open(str(path)) as file:
        rate, sound = file.getframerate(), np.frombuffer(file.readframes(file.getnframes()), np.int16)
    common = math.gcd(rate, RATE)
    return resample_poly(sound.astype(float), RATE // common, rate // common)


def rehearsal(path: Path) -> None:
    """Writes minutes of speech in which a known command and another sentence alternate."""
    room = np.random.default_rng(0).normal(0.0, 20.0, MINUTES * 60 * RATE)
    texts = ("puppet follow my pose", "look at the lights")
    sounds = [speech(text, path.parent) for text in texts]
    for number, start in enumerate(range(2 * RATE, len(room) - 5 * RATE, 9 * RATE)):
        sound = sounds[number % 2]
        room[start : start + len(sound)] += sound
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, RATE, 0, "NONE", ""))
        file.writeframes(room.clip(-32768, 32767).astype(np.int16).tobytes())


def carried_and_performed(path: Path) -> None:
    """Writes recorded depth: a person performs, then the camera is carried around a chair repeatedly.

    The path is closed, so the rounds follow each other without a jump. On a busy machine, the scan starts
    late.
    """
    person = list(Recording(find_shipped_recording()).frames())
    scan = HandheldScan(load_sample("chair"), load_profile("kinect1"), PATH, width=320, colour=True)
    carried = [scan.frame(index) for index in range(0, scan.frames, STEP)]
    with Recorder(path) as recorder:
        later = 0
        for frames in (person, person, *[carried] * ROUNDS):
            for frame in frames:
                recorder.write_frame(replace(frame, time_ns=later + frame.time_ns - frames[0].time_ns))
            later += frames[-1].time_ns - frames[0].time_ns + 33_000_000


@pytest.mark.skipif(
    "ENLIVEN_SITTING" not in os.environ,
    reason="it takes minutes: make test-long, or set ENLIVEN_SITTING=1",
)
@pytest.mark.skipif(shutil.which("espeak-ng") is None, reason="espeak-ng is not installed")
@pytest.mark.parametrize("needs", [("pocketsphinx", "mujoco")])
def test_one_sitting_scans_speaks_possesses_plays_and_records(needs: tuple[str, ...], tmp_path: Path) -> None:
    for library in needs:
        if importlib.util.find_spec(library) is None:
            pytest.skip(f"{library} is not installed")
    carried_and_performed(tmp_path / "depth.mcap")
    rehearsal(tmp_path / "say.wav")
    (tmp_path / "edge.toml").write_text(SETTINGS)
    words = [str(tmp_path), str(tmp_path / "depth.mcap"), str(tmp_path / "edge.toml")]
    report = in_a_window(SESSION, *words, seconds=1000.0)
    assert report["done"], report.get("missing", report)
    assert report["heard"].startswith("Heard: puppet follow my pose")
    assert report["not understood"].startswith("Not understood: ")
    assert report["phrases"] == 2
    # The performer may have returned by the time the pointer has reached the button.
    assert report["waits"].startswith(("No one is in view", "Stand still")), "a press is answered at once"
    assert report["held"] == ["Performer 1 is in the scan: the whole body"], "and done without another press"
    assert report["recorded"][0] > 0 and report["recorded"][1]
    assert report["moves"] > 0.02, "what was recorded plays"
    assert report["boxes"] == 48, "the towers, of which a box fell"
    assert len(report["possess moved"]) == 1, "the primary button never moves"
