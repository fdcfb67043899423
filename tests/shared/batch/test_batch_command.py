"""enliven batch, end to end with real worker processes. Some are killed."""

from __future__ import annotations

import os
import random
import signal
import threading
import time
from pathlib import Path

import pytest

from enliven.batch.jobs import find_finished_result
from enliven.batch.plan import BatchPlan, plan_jobs
from enliven.batch.scheduler import open_client, run_jobs
from enliven.cli import run
from enliven.errors import EnlivenError

pytest.importorskip("distributed", reason="Dask is not installed: pip install './shared[batch]'")


def _batch(library: Path, *options: str) -> int:
    folders = ["--motions", str(library / "motions"), "--characters", str(library / "characters")]
    return run(["batch", *folders, "-o", str(library / "out"), *options])


def test_a_dry_run_lists_and_writes_nothing(library: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _batch(library, "--dry-run") == 0
    assert capsys.readouterr().out.count("to do: ") == 4
    assert not list((library / "out").rglob("*.glb"))


def test_folders_must_be_given(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["batch"]) != 0
    assert "--motions FOLDER" in capsys.readouterr().err


@pytest.mark.slow
def test_all_pairs_are_done_once_and_a_failure_stops_no_other(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (library / "characters" / "broken.glb").write_bytes(b"broken")
    assert _batch(library, "--workers", "2") == 1
    printed = capsys.readouterr()
    assert "4 pairs are in" in printed.out
    assert "2 failed" in printed.out
    assert "walk on broken: " in printed.err
    (library / "characters" / "broken.glb").unlink()
    before = {path: path.stat().st_mtime_ns for path in (library / "out").rglob("*.glb")}
    assert _batch(library, "--workers", "1") == 0
    assert "4 from earlier runs" in capsys.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in (library / "out").rglob("*.glb")} == before


@pytest.mark.slow
def test_workers_that_are_killed_lose_nothing(library: Path) -> None:
    """Kills a worker process at random moments, while 60 jobs run on two of them."""
    walk = (library / "motions" / "walk.bvh").read_text()
    for number in range(28):
        (library / "motions" / f"walk-{number}.bvh").write_text(walk + "\n" * number)
    plan = BatchPlan((str(library / "motions"),), (str(library / "characters"),), str(library / "out"))
    jobs = plan_jobs(plan)
    ended, killed = threading.Event(), []

    def kill_workers(pids_of_workers) -> None:
        chance = random.Random(0)
        while not ended.wait(chance.uniform(1.0, 3.0)) and len(killed) < 4:
            pid = chance.choice(pids_of_workers())
            killed.append(pid)
            os.kill(pid, signal.SIGKILL)

    with open_client(workers=2) as client:

        def pids_of_workers() -> list[int]:
            return list(client.run(os.getpid).values())

        pids_of_workers()
        killer = threading.Thread(target=kill_workers, args=(pids_of_workers,))
        killer.start()
        results = list(run_jobs(jobs, client))
        ended.set()
        killer.join()
    assert killed
    assert sorted(result.job.output for result in results) == sorted(job.output for job in jobs)
    assert [result.problem for result in results if result.problem] == []
    assert all(find_finished_result(job) for job in jobs)
    leftovers = [path for path in (library / "out").rglob("*") if path.is_file() and ".part" in path.name]
    assert len(leftovers) <= len(killed), "only the file that a killed worker was writing may remain"


@pytest.mark.slow
def test_a_scheduler_that_is_absent_is_named() -> None:
    began = time.monotonic()
    with (
        pytest.raises(EnlivenError, match="no Dask scheduler answers"),
        open_client(scheduler="tcp://127.0.0.1:9"),
    ):
        pass
    assert time.monotonic() > began


def test_an_address_must_be_one() -> None:
    with pytest.raises(EnlivenError), open_client(scheduler="nonsense://x"):
        pass
