"""Prepares the edge before its first frame, and shows the step under way on a terminal."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from enliven_edge.stage import cast
from enliven_edge.stage.puppet import is_puppet
from enliven_edge.warmup import warm_up_tracking

if TYPE_CHECKING:
    from enliven_edge.settings import EdgeSettings
    from enliven_edge.stage import Actor


def prepared(mesh: str, chosen: EdgeSettings) -> Actor:
    """Returns the actor with every kernel compiled: most of a minute the first time, a second later on."""
    with _steps(f"Preparing {mesh}: sampling, linking, weighting", total=3) as then:
        actor = _cast(mesh, chosen)
        then("Compiling the solver (kept for the next start)")
        actor.warm_up()
        then("Compiling the tracker (kept for the next start)")
        warm_up_tracking(chosen.tracker)
    return actor


def _cast(mesh: str, chosen: EdgeSettings) -> Actor:
    """Returns the actor that was asked for; only the modules that it needs are loaded."""
    if is_puppet(mesh):
        from enliven_edge.stage.puppet import cast_puppet

        return cast_puppet(mesh, chosen.puppet)
    if chosen.drive == "skeleton":
        from enliven_edge.stage.rig import cast_rig

        return cast_rig(mesh, chosen.matching)
    return cast(mesh, chosen.nodes, chosen.actor, chosen.up)


@contextlib.contextmanager
def _steps(first: str, total: int) -> Iterator[Callable[[str], None]]:
    """Yields a function that names the next step; on a terminal the step under way is shown."""
    if not sys.stderr.isatty():
        yield lambda step: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(first, total=total)
        yield lambda step: progress.update(task, advance=1, description=step)
