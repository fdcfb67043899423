"""The command ``enliven train-estimator``: trains the pose network on rendered synthetic people."""

from __future__ import annotations

import copy
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from enliven.errors import InputError
from enliven.settings import load_settings


def train_estimator(
    output: Annotated[Path, typer.Option("--output", "-o", help="The network to make, an .onnx file.")],
    pictures: Annotated[int, typer.Option(help="Rendered pictures to learn from.")] = 110_000,
    steps: Annotated[int, typer.Option(help="Steps of the training.")] = 12_000,
    batch: Annotated[int, typer.Option(help="Pictures in a step.")] = 128,
    seed: Annotated[int, typer.Option(help="Fixes everything random.")] = 0,
    start: Annotated[
        Path | None,
        typer.Option(help="A network from this command; training continues from it."),
    ] = None,
    share: Annotated[
        float,
        typer.Option(
            min=0.0, max=1.0, help="With --start, how far to go from the old weights (0) to the new ones (1)."
        ),
    ] = 1.0,
    album: Annotated[
        Path | None,
        typer.Option(help="A folder for the rendered pictures; they are reused if they exist."),
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing file.")] = False,
) -> None:
    """Learn to see where the joints are in depth, from rendered people in random postures.

    Nothing is downloaded and no recording is used. The defaults take little more than an hour of two cores,
    and 5 GB of disk. Where PyTorch finds a graphics card with CUDA it learns there: the network that ships
    with enliven has learnt for eight minutes in steps of 1024 pictures. A network that is there already is
    trained on with --start, in less; with a --share of what it learns it forgets less. It needs PyTorch:
    pip install "enliven-synthesis[training]".

    \b
      enliven train-estimator -o estimator.onnx --pictures 224000 --steps 22000 --batch 1024     on a card
      enliven train-estimator -o estimator.onnx                  a lesser one, on two cores
      enliven train-estimator -o small.onnx --pictures 8000 --steps 500     a lesser one, in four minutes
      enliven train-estimator --start estimator.onnx -o better.onnx --pictures 40000 --steps 2400 --share 0.4
    """
    if output.suffix != ".onnx":
        raise InputError(
            "a network is an .onnx file", where=str(output), mend="Give a name that ends in .onnx."
        )
    if output.exists() and not overwrite:
        raise InputError(
            "this file is there already", where=str(output), mend="Add --overwrite to replace it."
        )
    if not output.absolute().parent.is_dir():
        raise InputError("this folder does not exist", where=str(output.parent), mend="Make it first.")
    if start is not None and not start.is_file():
        raise InputError("this network does not exist", where=str(start), mend="Name an .onnx file.")
    try:
        for package in ("torch", "onnx", "onnxscript"):
            import_module(package)
    except ModuleNotFoundError as missing:
        raise InputError(
            f"training needs {missing.name}, which is not installed",
            where="train-estimator",
            mend='Install it: pip install "enliven-synthesis[training]".',
        ) from None
    from enliven_synthesis.training import Dataset, render_dataset
    from enliven_synthesis.training.pose_network import (
        FINE_TUNING_RATE,
        VALIDATION_SAMPLES,
        TrainingSettings,
        export,
        interpolate_networks,
        measure,
        quantise,
        restore_network,
        train,
    )

    values: dict[str, object] = {"pictures": pictures, "steps": steps, "batch": batch, "seed": seed}
    if start is not None:
        values["rate"] = FINE_TUNING_RATE
    settings = load_settings(TrainingSettings, values, where="train-estimator")
    with tempfile.TemporaryDirectory() as spare, Progress(transient=True) as progress:
        if album is not None and album.exists() and any(album.iterdir()):
            dataset = Dataset(album)
        else:
            rendering = progress.add_task("Rendering", total=settings.pictures)
            dataset = render_dataset(
                album or Path(spare) / "album", settings.pictures, settings.frontal, settings.seed,
                lambda more: progress.advance(rendering, more),
            )  # fmt: skip
        learning = progress.add_task("Learning", total=settings.steps)
        start_network = None if start is None else restore_network(start, dataset, VALIDATION_SAMPLES)
        before = None if start_network is None else copy.deepcopy(start_network)
        network = train(dataset, settings, lambda _step, _network: progress.advance(learning), start_network)
        if before is not None:
            network = interpolate_networks(before, network, share)
        whole, small = Path(spare) / "whole.onnx", Path(spare) / "small.onnx"
        export(network, whole)
        quantise(whole, small, dataset, VALIDATION_SAMPLES)
        scores = measure(small, dataset)
        output.write_bytes(small.read_bytes())
    typer.echo(f"{output}: {output.stat().st_size / 1e6:.2f} MB")
    typer.echo(
        f"joints within 10 cm: {scores.within[0]:.3f} told how people face, {scores.within[1]:.3f} not told; "
        f"facing told rightly {scores.facing:.3f}, parts {scores.parts:.3f}, people {scores.persons:.3f}"
    )
