"""``enliven train-parts``: the forest of body parts, learnt from people that the project makes up itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from enliven.errors import InputError
from enliven.settings import load_settings


def train_parts(
    output: Annotated[Path, typer.Option("--output", "-o", help="The forest to make, a .npz file.")],
    pictures: Annotated[int, typer.Option(help="Rendered pictures to learn from.")] = 20000,
    trees: Annotated[int, typer.Option(help="Trees of the forest.")] = 3,
    frontal: Annotated[float, typer.Option(help="Share of people who look at the sensor.")] = 0.35,
    depth: Annotated[int, typer.Option(help="Questions from a root to a leaf, at most.")] = 18,
    seed: Annotated[int, typer.Option(help="Fixes everything random.")] = 0,
    test: Annotated[int, typer.Option(min=0, help="Fresh pictures to measure it on.")] = 300,
    overwrite: Annotated[bool, typer.Option(help="Replace an existing file.")] = False,
) -> None:
    """Learn to tell the parts of a body in depth, from rendered people in random postures.

    Nothing is downloaded and no recording is used. The defaults make the forest that ships with enliven, in
    about half an hour of one core and with 2 GB of memory; the same options make the same forest again.

    \b
      enliven train-parts -o parts.npz                        the forest that ships with enliven, again
      enliven train-parts -o small.npz --pictures 2000 --depth 14     a lesser one, in three minutes
    """
    from enliven_edge.parts.accuracy import measure
    from enliven_edge.parts.training import TrainingSettings, render_album, train, with_facing

    if output.suffix != ".npz":
        raise InputError("a forest is a .npz file", where=str(output), mend="Give a name that ends in .npz.")
    if output.exists() and not overwrite:
        raise InputError(
            "this file is there already", where=str(output), mend="Add --overwrite to replace it."
        )
    values = {"pictures": pictures, "trees": trees, "frontal": frontal, "depth": depth, "seed": seed}
    settings = load_settings(TrainingSettings, values, where="train-parts")
    with Progress(transient=True) as progress:
        rendering = progress.add_task("Rendering", total=settings.pictures)
        album = render_album(settings, lambda _: progress.advance(rendering))
        growing = progress.add_task("Growing trees", total=settings.trees)
        forest = train(album, settings, lambda _number, _seconds: progress.advance(growing))
        watching = progress.add_task("Learning which way people face", total=settings.facing)
        forest = with_facing(forest, settings, lambda _: progress.advance(watching))
    forest.save(output)
    leaves = len(forest.trees.posterior)
    typer.echo(f"{output}: {settings.trees} trees, {leaves} leaves, {output.stat().st_size / 1e6:.2f} MB")
    if test:
        found = measure(forest, test, seed)
        typer.echo(found.table())
