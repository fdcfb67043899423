"""Counts hits, misses and false alarms of spoken commands, with synthetic voices, speeds, noise and other
speech.

.venv/bin/python tests/benchmarks/voice_recognition.py [NUMBER OF A VOICE]

It needs espeak-ng; flite adds recorded voices.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
import tempfile
import wave
from pathlib import Path

import numpy as np
from scipy.signal import resample_poly

from enliven.settings import load_settings
from enliven_edge.controls.voice import RATE, Recogniser
from enliven_edge.settings import EdgeSettings

SHIPPED = Path(__file__).resolve().parents[2] / "firmware_configs" / "controls" / "voice.toml"
PHRASES = tuple(load_settings(EdgeSettings, SHIPPED).controls["voice"].map)
VOICES = (
    ("espeak-ng", "-v", "en-us", "-s", "140"),
    ("espeak-ng", "-v", "en-us", "-s", "185"),
    ("espeak-ng", "-v", "en-gb-x-rp+f3", "-s", "150"),
    ("flite", "-voice", "slt"),
    ("flite", "-voice", "rms"),
    ("flite", "-voice", "kal16"),
)
"""Speech synthesis programs, with their voice and speed."""
OTHER = (
    "step in", "release the chair", "what time is it", "the camera is too low", "could you move to the left",
    "puppet jump up", "puppet walk away", "puppet sing a song", "puppet open the door", "puppet wake up now",
    "puppet please be quiet", "puppet count to ten", "puppet are you there",
)  # fmt: skip
"""Speech that matches no command, also after the wake word."""
NOISE = (20.0, 200.0)
"""Noise level of the room (standard deviation; speech peaks at 9,000): quiet, and 33 dB below the peaks."""


def speak(text: str, voice: tuple[str, ...], folder: Path) -> np.ndarray:
    """Returns a spoken sentence at 16 kHz, with peaks at 9,000."""
    path = folder / "sentence.wav"
    out = ["-w", str(path), text] if voice[0] == "espeak-ng" else ["-t", text, "-o", str(path)]
    subprocess.run([*voice, *out], check=True, stdout=subprocess.DEVNULL)
    with wave.open(str(path)) as file:
        rate, sound = file.getframerate(), np.frombuffer(file.readframes(file.getnframes()), np.int16)
    common = math.gcd(rate, RATE)
    sound = resample_poly(sound.astype(float), RATE // common, rate // common)
    return sound * 9000.0 / max(np.abs(sound).max(), 1.0)


def listen(recogniser: Recogniser, sound: np.ndarray, noise: float) -> tuple[list[str], list[str]]:
    """Returns the recognised phrases and other speech in a sound, padded with a second of room noise on both
    sides."""
    room = np.random.default_rng(0).normal(0.0, noise, len(sound) + 2 * RATE)
    room[RATE:-RATE] += sound
    data, step = room.clip(-32768, 32767).astype(np.int16).tobytes(), recogniser.frame_bytes
    frames = (data[i : i + step] for i in range(0, len(data) - step + 1, step))
    phrases = [phrase for phrase in map(recogniser.feed, frames) if phrase is not None]
    while recogniser.is_busy:
        recogniser.decode_next_part()
    return phrases, recogniser.take_not_understood()


def noises() -> dict[str, np.ndarray]:
    """Returns eight seconds each of sounds without speech."""
    random, time = np.random.default_rng(1), np.arange(8 * RATE) / RATE
    spectrum = np.fft.rfft(random.normal(size=len(time)))
    pink = np.fft.irfft(spectrum / np.sqrt(np.maximum(np.arange(len(spectrum)), 1)), len(time))
    pink *= 4000.0 / pink.std()
    return {
        "silence": np.zeros(len(time)),
        "hiss": random.normal(0.0, 3000.0, len(time)),
        "hum": 8000.0 * np.sin(2 * np.pi * 50.0 * time),
        "claps": random.normal(0.0, 9000.0, len(time)) * np.exp(-40.0 * (time % 0.7)),
        "thumps": 9000.0 * np.sin(2 * np.pi * 80.0 * time) * np.exp(-20.0 * (time % 0.9)),
        "tones": 6000.0 * np.sin(2 * np.pi * 440.0 * time) * (time % 1.0 < 0.5),
        "bursts": pink * (time % 1.5 < 0.6),
        "breath": 0.5 * pink * np.maximum(0.0, np.sin(2 * np.pi * time / 2.5)),
    }


def main() -> int:
    chosen = VOICES if len(sys.argv) < 2 else VOICES[int(sys.argv[1]) :][:1]
    voices = [voice for voice in chosen if shutil.which(voice[0])]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for noise in NOISE:
            total = np.zeros(6, int)
            for voice in voices:
                recogniser, row = Recogniser(PHRASES), np.zeros(6, int)
                for phrase in PHRASES:
                    heard, other = listen(recogniser, speak(phrase, voice, folder), noise)
                    row[:3] += (
                        heard == [phrase],
                        any(other_phrase != phrase for other_phrase in heard),
                        bool(other),
                    )
                for text in OTHER:
                    heard, other = listen(recogniser, speak(text, voice, folder), noise)
                    row[3:] += bool(heard), bool(other), not heard and not other
                total += row
                print(f"  {' '.join(voice)}, noise {noise:g}: {row.tolist()}", flush=True)
            hits, wrong, missed, alarms, shown, nothing = total.tolist()
            count, others = len(voices) * len(PHRASES), len(voices) * len(OTHER)
            print(f"noise {noise:g}: of {count} phrases {hits} heard, {wrong} taken for another, ")
            print(f"  {missed} shown as not understood; of {others} other sentences {alarms} taken for a ")
            print(f"  phrase, {shown} shown as not understood, {nothing} without a sign")
    recogniser = Recogniser(PHRASES)
    for kind, sound in noises().items():
        print(f"{kind}: {listen(recogniser, sound, 0.0)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
