"""The command ``enliven train-estimator``: trains the pose network on rendered synthetic people."""

from __future__ import annotations

import copy
import tempfile
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from enliven.errors import InputError
from enliven.settings import load_settings


def train_estimator(
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Path of the trained network, an .onnx file.")
    ],
    pictures: Annotated[int, typer.Option(help="Number of rendered training pictures.")] = 110_000,
    steps: Annotated[int, typer.Option(help="Number of training steps.")] = 12_000,
    batch: Annotated[int, typer.Option(help="Number of pictures per training step.")] = 128,
    seed: Annotated[int, typer.Option(help="Seed of all random numbers.")] = 0,
    start: Annotated[
        Path | None,
        typer.Option(help="A network from this command, as the start of the training."),
    ] = None,
    share: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1.0,
            help="With --start, weight of the new network: 0 keeps the old network, 1 uses only the new "
            "network.",
        ),
    ] = 1.0,
    album: Annotated[
        Path | None,
        typer.Option(help="Folder for the rendered pictures. Existing pictures in it are reused."),
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing file.")] = False,
) -> None:
    """Train the pose network, which finds joints in depth, on rendered people in random postures.

    Nothing is downloaded and no recording is used. The defaults take a little over an hour on two cores, and
    5 GB of disk. With a CUDA graphics card the training runs there. The shipped network was trained for eight
    minutes in steps of 1024 pictures. --start fine-tunes an existing network in less time, and a --share
    below 1 keeps more of its knowledge. The training needs PyTorch: pip install
    "enliven-synthesis[training]".

    \b
      enliven train-estimator -o estimator.onnx --pictures 224000 --steps 22000 --batch 1024     on a card
      enliven train-estimator -o estimator.onnx                  a lesser one, on two cores
      enliven train-estimator -o small.onnx --pictures 8000 --steps 500     a lesser one, in four minutes
      enliven train-estimator --start estimator.onnx -o better.onnx --pictures 40000 --steps 2400 --share 0.4
    """
    _check_paths(output, start, overwrite)
    _require_training_packages()
    from enliven_synthesis.training.dataset import Dataset, render_dataset
    from enliven_synthesis.training.pose_network.quantisation import quantise
    from enliven_synthesis.training.pose_network.training import (
        FINE_TUNING_RATE,
        FRONTAL_FRACTION,
        VALIDATION_SAMPLES,
        TrainingSettings,
        export,
        measure,
        train,
    )
    from enliven_synthesis.training.pose_network.weight_import import interpolate_networks, restore_network

    values: dict[str, object] = {"pictures": pictures, "steps": steps, "batch": batch, "seed": seed}
    settings = load_settings(TrainingSettings, values, where="train-estimator")
    if start is not None:
        settings = replace(settings, rate=FINE_TUNING_RATE)
    with tempfile.TemporaryDirectory() as spare, Progress(transient=True) as progress:
        if album is not None and album.exists() and any(album.iterdir()):
            dataset = Dataset(album)
        else:
            rendering = progress.add_task("Rendering", total=settings.pictures)
            dataset = render_dataset(
                album or Path(spare) / "album", settings.pictures, FRONTAL_FRACTION, settings.seed,
                lambda more: progress.advance(rendering, more),
            )  # fmt: skip
        learning = progress.add_task("Learning", total=settings.steps)
        start_network = None if start is None else restore_network(start, dataset, VALIDATION_SAMPLES)
        start_copy = None if start_network is None else copy.deepcopy(start_network)
        network = train(dataset, settings, lambda _step, _network: progress.advance(learning), start_network)
        if start_copy is not None:
            network = interpolate_networks(start_copy, network, share)
        whole, small = Path(spare) / "whole.onnx", Path(spare) / "small.onnx"
        export(network, whole)
        quantise(whole, small, dataset, VALIDATION_SAMPLES)
        scores = measure(small, dataset)
        output.write_bytes(small.read_bytes())
    typer.echo(f"{output}: {output.stat().st_size / 1e6:.2f} MB")
    typer.echo(
        f"fraction of joints within 10 cm: {scores.within[0]:.3f} with known facing, "
        f"{scores.within[1]:.3f} without; "
        f"fraction of correct results: facing {scores.facing:.3f}, parts {scores.parts:.3f}, people "
        f"{scores.persons:.3f}"
    )


def _check_paths(output: Path, start: Path | None, overwrite: bool) -> None:
    """Raises InputError if the network cannot be written to ``output``, or if ``start`` is missing."""
    if output.suffix != ".onnx":
        raise InputError(
            "the network file must have the suffix .onnx",
            where=str(output),
            remedy="Choose a name that ends in .onnx.",
        )
    if output.exists() and not overwrite:
        raise InputError(
            "the file exists already", where=str(output), remedy="Add --overwrite to replace it."
        )
    if not output.absolute().parent.is_dir():
        raise InputError(
            "this folder does not exist", where=str(output.parent), remedy="Create the folder first."
        )
    if start is not None and not start.is_file():
        raise InputError(
            "this network file does not exist", where=str(start), remedy="Choose an existing .onnx file."
        )


def _require_training_packages() -> None:
    """Raises InputError if a package that only the training needs is not installed."""
    try:
        for package in ("torch", "onnx", "onnxscript"):
            import_module(package)
    except ModuleNotFoundError as missing:
        raise InputError(
            f"training needs {missing.name}, which is not installed",
            where="train-estimator",
            remedy='Install it: pip install "enliven-synthesis[training]".',
        ) from None
