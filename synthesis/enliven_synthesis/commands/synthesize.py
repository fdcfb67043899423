"""The command ``enliven synthesize``: records a synthetic performer with the true joints."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import track

from enliven.settings import load_settings

if TYPE_CHECKING:
    from enliven.recording import Recorder
    from enliven_synthesis.sensor.studio import SyntheticStudio


def synthesize(
    output: Annotated[Path, typer.Option("--output", "-o", help="Output recording.")],
    choreography: Annotated[str, typer.Option(help="Motion: chair, walk, wave, idle or wander.")] = "chair",
    profile: Annotated[str, typer.Option(help="Camera: the name of a profile, or a .toml file.")] = "kinect1",
    seed: Annotated[int, typer.Option(help="Seed of all random numbers.")] = 0,
    width: Annotated[int, typer.Option(help="Width in pixels. 0: the camera's own width.")] = 320,
    noise: Annotated[bool, typer.Option(help="Simulate the noise and the faults of the camera.")] = True,
    level: Annotated[
        int, typer.Option(min=1, max=22, help="Compression level: 1 is fast, 19 gives small files.")
    ] = 19,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing recording.")] = False,
) -> None:
    """Make a depth recording of a synthetic performer, with the true joints.

    The same options give the same images and joints on every machine, and the same file, bit for bit, with
    the same versions of enliven, mcap and zstandard.

    \b
      enliven synthesize -o chair.mcap             the recording that ships with enliven, again
      enliven synthesize -o wave.mcap --choreography wave --profile oak-d --width 0
    """
    from enliven.recording import Recorder
    from enliven_synthesis.sensor.profile import load_profile
    from enliven_synthesis.sensor.studio import SyntheticSettings, SyntheticStudio

    values = {"choreography": choreography, "seed": seed, "width": width, "noise": noise}
    studio = SyntheticStudio(
        load_profile(profile), load_settings(SyntheticSettings, values, where="synthesize")
    )
    with Recorder(output, compression_level=level, sync_seconds=math.inf, overwrite=overwrite) as recorder:
        recorder.add_metadata(
            "synthesize", {key: str(value) for key, value in {**values, "profile": profile}.items()}
        )
        for _ in track(write_performance(studio, recorder), "Rendering", total=studio.frames, transient=True):
            pass
    typer.echo(f"{output}: {studio.frames} frames of {studio.sensor}, {output.stat().st_size / 1e6:.2f} MB")


def write_performance(studio: SyntheticStudio, recorder: Recorder) -> Iterator[int]:
    """Writes one run of the choreography, depth and ground truth. Yields each frame's number after writing
    it."""
    from enliven.frames import BodyFrame

    for index in range(studio.frames):
        frame = studio.frame(index)
        recorder.write_frame(frame)
        recorder.write_truth(BodyFrame([studio.body(frame.time_ns)], frame.time_ns, frame.sensor))
        yield index
