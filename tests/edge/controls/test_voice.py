"""Tests of spoken commands with the real PocketSphinx. A speech synthesiser says commands and other
phrases.
"""

from __future__ import annotations

import contextlib
import functools
import io
import logging
import math
import shutil
import subprocess
import sys
import wave
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import resample_poly

from enliven.errors import InputError
from enliven.settings import load_settings
from enliven.wire import HeardMessage, VoiceMessage
from enliven_edge.controls.control_set import open_controls, open_readers
from enliven_edge.controls.other_speech import OtherSpeech
from enliven_edge.controls.settings import ControlSettings
from enliven_edge.controls.voice import RATE, Recogniser, SoundRecording
from enliven_edge.settings import EdgeSettings
from enliven_edge.stage.stage import Stage

sys.path.insert(0, str(Path(__file__).parent))

from patience import wait_until

pytest.importorskip("pocketsphinx", reason="pocketsphinx is not installed (the extra 'voice')")

SHIPPED = Path(__file__).resolve().parents[3] / "firmware_configs" / "controls" / "voice.toml"
SETTINGS = load_settings(EdgeSettings, SHIPPED).controls["voice"]

spoken = pytest.mark.skipif(shutil.which("espeak-ng") is None, reason="espeak-ng is not installed")


@functools.cache
def said(text: str, voice: str = "en-us") -> bytes:
    """Returns a phrase spoken in a quiet room at 16 kHz, with one second of silence before and after it."""
    command = ["espeak-ng", "-v", voice, "-s", "140", "--stdout", text]
    with wave.open(io.BytesIO(subprocess.run(command, capture_output=True, check=True).stdout)) as file:
        # espeak writes to a pipe, so the length in its header is wrong.
        rate, sound = file.getframerate(), np.frombuffer(file.readframes(10 * file.getframerate()), np.int16)
    common = math.gcd(rate, RATE)
    sound = resample_poly(sound.astype(float), RATE // common, rate // common)
    quiet = np.random.default_rng(0).normal(0.0, 20.0, len(sound) + 2 * RATE)
    quiet[RATE:-RATE] += sound
    return quiet.clip(-32768, 32767).astype(np.int16).tobytes()


@pytest.fixture(scope="module")
def other() -> OtherSpeech:
    """Returns the language models for other speech, which take a second to load."""
    return OtherSpeech()


@pytest.fixture
def recogniser(other: OtherSpeech) -> Recogniser:
    """Returns a new recogniser, since a recogniser adapts to the sound level."""
    other.forget()  # the phrase of the previous test
    return Recogniser(list(SETTINGS.map), other=other)


def heard(recogniser: Recogniser, sound: bytes) -> list[str]:
    step = recogniser.frame_bytes
    frames = (sound[i : i + step] for i in range(0, len(sound) - step + 1, step))
    return [phrase for phrase in map(recogniser.feed, frames) if phrase is not None]


@spoken
@pytest.mark.slow
def test_most_commands_are_heard_and_none_is_taken_for_another(recogniser):
    right = 0
    for phrase in SETTINGS.map:
        commands = heard(recogniser, said(phrase))
        assert commands in ([], [phrase])
        right += commands == [phrase]
    assert right >= 7


@pytest.mark.slow
@spoken
def test_two_commands_in_a_row_are_both_recognised(recogniser):
    assert heard(recogniser, said("puppet let it go") + said("puppet follow my pose")) == [
        "puppet let it go",
        "puppet follow my pose",
    ]


@spoken
@pytest.mark.parametrize(
    "talk",
    ["yes", "stop", "look at the lights", "lower your arms", "what time is it", "show me the other one"],
)
def test_other_speech_is_not_a_command(recogniser, talk):
    assert heard(recogniser, said(talk)) == []


def not_understood(recogniser: Recogniser, sound: bytes) -> tuple[list[str], list[str]]:
    phrases = heard(recogniser, sound)
    while recogniser.is_busy:
        recogniser.decode_next_part()
    return phrases, recogniser.take_not_understood()


@pytest.mark.slow
@spoken
@pytest.mark.parametrize("text", ["look at the lights", "puppet walk away", "puppet sing a song"])
def test_speech_that_is_no_phrase_is_reported_with_words(recogniser, text):
    phrases, others = not_understood(recogniser, said(text))
    assert phrases == [] and len(others) == 1 and len(others[0].split()) >= 2
    assert not_understood(recogniser, said("puppet follow my pose")) == (["puppet follow my pose"], [])


@pytest.mark.parametrize("kind", ["silence", "hiss", "hum", "claps"])
def test_sounds_without_speech_give_no_command(recogniser, kind):
    random, time = np.random.default_rng(1), np.arange(8 * RATE) / RATE
    sound = {
        "silence": np.zeros(len(time)),
        "hiss": random.normal(0.0, 3000.0, len(time)),
        "hum": 8000.0 * np.sin(2 * np.pi * 50.0 * time),
        "claps": random.normal(0.0, 9000.0, len(time)) * np.exp(-40.0 * (time % 0.7)),
    }[kind]
    assert not_understood(recogniser, sound.clip(-32768, 32767).astype(np.int16).tobytes()) == ([], [])


@spoken
@pytest.mark.slow
def test_viewers_receive_heard_phrases_and_their_commands(tmp_path):
    written(tmp_path / "say.wav", said("puppet follow my pose") + said("look at the lights"))
    for hides_talk in (False, True):
        settings = ControlSettings("voice", dict(SETTINGS.map), wav="say.wav")
        sent: list[HeardMessage | VoiceMessage] = []
        with open_controls({"voice": settings}, tmp_path, hides_talk=hides_talk) as controls:

            def poll() -> bool:
                controls.apply_commands(Stage([]), lambda order: None, lambda word, name: None, sent.append)  # noqa: B023
                return sum(isinstance(message, HeardMessage) for message in sent) == 2  # noqa: B023

            wait_until(poll)
        first, second = (message for message in sent if isinstance(message, HeardMessage))
        assert first == HeardMessage("voice", "puppet follow my pose", True, "follow")
        assert not second.understood and bool(second.words) is not hides_talk
        states = [message for message in sent if isinstance(message, VoiceMessage)]
        assert "listening" in {each.state for each in states} and len(states[0].phrases) == len(SETTINGS.map)


def test_microphone_is_opened_and_closed_by_command_or_gives_a_reason():
    pytest.importorskip("sounddevice", reason="sounddevice is not installed", exc_type=(ImportError, OSError))
    sent: list[VoiceMessage] = []

    def poll(state: str) -> bool:
        controls.apply_commands(Stage([]), lambda order: None, lambda word, name: None, sent.append)
        return sent[-1].state == state

    with open_controls({}) as controls:
        assert poll("off") and "puppet take it" in sent[-1].phrases
        controls.listen(True)
        wait_until(lambda: poll("missing") or poll("listening"))
        if sent[-1].state == "missing":
            assert sent[-1].what and sent[-1].remedy
        controls.listen(False)
        wait_until(lambda: poll("off"))


def test_a_word_that_the_model_does_not_know_is_refused():
    with pytest.raises(InputError, match="does not know the word 'brzlfx'"):
        Recogniser(["puppet brzlfx"])


def written(path: Path, sound: bytes, rate: int = RATE, channels: int = 1) -> Path:
    with wave.open(str(path), "wb") as file:
        file.setparams((channels, 2, rate, 0, "NONE", ""))
        file.writeframes(sound)
    return path


@pytest.mark.slow
@spoken
def test_recording_replaces_the_microphone(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    written(tmp_path / "say.wav", said("puppet follow my pose"))
    settings = ControlSettings("voice", dict(SETTINGS.map), wav="say.wav")
    (reader,) = open_readers({"voice": settings}, tmp_path)
    with contextlib.closing(reader):
        wait_until(lambda: "has ended" in caplog.text)
        assert reader.poll() == ["follow"]


def test_a_recording_comes_in_its_own_time(tmp_path):
    waits: list[float] = []
    recording = SoundRecording(written(tmp_path / "still.wav", bytes(RATE)), waits.append)
    recording.open(960)
    frames = 0
    with pytest.raises(EOFError):
        while True:
            assert len(recording.read()) == 960
            frames += 1
    assert frames == 3 * RATE // 960
    assert all(0.0 <= wait <= 1.51 for wait in waits) and waits[-1] > waits[0]


def test_another_kind_of_wav_is_refused(tmp_path):
    path = written(tmp_path / "stereo.wav", bytes(400), rate=44100, channels=2)
    with pytest.raises(InputError, match=r"44100 Hz, 2 channels.*to 16000 Hz"):
        SoundRecording(path).open(960)
    path.write_bytes(b"no sound")
    with pytest.raises(InputError, match="not a WAV file"):
        SoundRecording(path).open(960)


def test_missing_microphone_is_searched_while_the_edge_continues(caplog):
    try:
        import sounddevice  # noqa: F401
    except (ImportError, OSError) as error:
        pytest.skip(f"no sounddevice or PortAudio: {error}")
    caplog.set_level(logging.DEBUG)
    settings = ControlSettings("voice", dict(SETTINGS.map), microphone="nobody's microphone", retry=0.01)
    (reader,) = open_readers({"voice": settings})
    with contextlib.closing(reader):
        wait_until(
            lambda: caplog.text.count("Traceback") >= 3
        )  # three tries, each with a restarted PortAudio
        assert reader.poll() == []
    assert caplog.text.count("is not available") == 1
