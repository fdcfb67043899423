"""Batch retargeting: rate, efficiency of two workers, cost of one job.

    batch.pairs_per_minute  ten motions onto ten characters with two workers
    batch.efficiency        speed of two workers over twice the speed of one, with the same pairs
    batch.overhead_ms       time that Dask adds to a job, on one worker

Kernels are compiled, and workers have imported all modules, before the measurement. On a machine with other
work, the efficiency is lower than on an idle one. ENLIVEN_BATCH_COUNT=3 measures with three motions and
characters, in a short time. Then one worker often waits for the last job of the other, so the efficiency is
too low.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
from distributed import Client
from figure import Figure

from enliven.batch.jobs import BatchJob, run_job
from enliven.batch.plan import BatchPlan, plan_jobs
from enliven.batch.scheduler import open_client, run_jobs

DATA = Path(os.environ.get("ENLIVEN_DATA", str(Path(__file__).parents[3] / "shared" / "data")))
MOTIONS, CHARACTERS = "bvh", "gltf/quaternius"
_COUNT = int(os.environ.get("ENLIVEN_BATCH_COUNT", "10"))
"""Number of motions and of characters."""
_EMPTY_JOBS = 300
"""Number of jobs without work. Each ends at once, because its motion does not exist."""


def figures() -> Iterator[Figure]:
    """Yields the three figures, or nothing without the data."""
    motions = sorted((DATA / MOTIONS).rglob("*.bvh"))[:_COUNT]
    characters = sorted((DATA / CHARACTERS).glob("*.glb"))[:_COUNT]
    if not motions or not characters:
        print(f"not measured: {MOTIONS} or {CHARACTERS} of ENLIVEN_DATA is missing")
        return
    with tempfile.TemporaryDirectory() as folder:
        jobs = _make_jobs(motions, characters, Path(folder) / "two")
        one_s, overhead_s = _run_on_one(_make_jobs(motions, characters, Path(folder) / "one"))
        two_s = _run_on_two(jobs)
    yield Figure("batch.pairs_per_minute", len(jobs) / two_s * 60.0, "pairs/min")
    yield Figure("batch.efficiency", one_s / (2.0 * two_s), "ratio")
    yield Figure("batch.overhead_ms", overhead_s * 1000.0, "ms")


def _run_on_one(jobs: list[BatchJob]) -> tuple[float, float]:
    """Returns the seconds of a batch on one worker, and the seconds per job that Dask adds."""
    empty = [
        msgspec.structs.replace(jobs[0], motion="no-such.bvh", digest=f"{n:064}") for n in range(_EMPTY_JOBS)
    ]
    with open_client(workers=1) as client:
        client.run(_warm_up, jobs[0])
        took_s = _time_jobs(jobs, client)
        begin = time.perf_counter()
        direct_s = sum(result.took_s for result in run_jobs(empty, client))
        overhead_s = (time.perf_counter() - begin - direct_s) / len(empty)
    return took_s, overhead_s


def _run_on_two(jobs: list[BatchJob]) -> float:
    """Returns the seconds of a batch on two workers of this computer, without the time to start them."""
    with open_client(workers=2) as client:
        client.run(_warm_up, jobs[0])
        return _time_jobs(jobs, client)


def _time_jobs(jobs: list[BatchJob], client: Client) -> float:
    """Returns the seconds of a batch."""
    begin = time.perf_counter()
    results = list(run_jobs(jobs, client))
    took_s = time.perf_counter() - begin
    failed = [result for result in results if result.problem]
    assert not failed, failed[0].problem
    return took_s


def _make_jobs(motions: list[Path], characters: list[Path], output: Path) -> list[BatchJob]:
    """Returns the jobs of all pairs."""
    plan = BatchPlan(tuple(map(str, motions)), tuple(map(str, characters)), str(output))
    return plan_jobs(plan)


def _warm_up(job: BatchJob) -> None:
    """Imports the modules and loads the kernels in a worker."""
    with tempfile.TemporaryDirectory() as folder:
        run_job(BatchJob(job.motion, job.character, f"{folder}/out.glb", job.options, "0" * 64))
