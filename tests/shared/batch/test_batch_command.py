"""Tests of ``enliven batch`` with real worker processes, some of which are killed."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from enliven.batch import scheduler
from enliven.batch.jobs import BatchJob, JobResult, find_finished_result
from enliven.batch.plan import BatchPlan, plan_jobs
from enliven.batch.scheduler import open_client, run_jobs
from enliven.cli import run
from enliven.errors import EnlivenError
from enliven.formats.gltf.read import read_gltf

if TYPE_CHECKING:
    from distributed import Client

pytest.importorskip("distributed", reason="Dask is not installed: pip install './shared[batch]'")

_MAX_WAIT_S = 300.0
"""Maximum time to wait for a batch, in seconds. Machines with other work are slow."""


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
    """Kills one of two workers after four random numbers of results, while 100 jobs run on them."""
    walk = (library / "motions" / "walk.bvh").read_text()
    for number in range(48):
        (library / "motions" / f"walk-{number}.bvh").write_text(walk + "\n" * number)
    plan = BatchPlan((str(library / "motions"),), (str(library / "characters"),), str(library / "out"))
    jobs = plan_jobs(plan)
    assert len(jobs) == 100
    chance = random.Random(0)
    kill_after = set(chance.sample(range(5, 90), 4))
    results, killed = [], []
    with open_client(workers=2) as client:
        for result in run_jobs(jobs, client):
            results.append(result)
            if len(results) in kill_after:
                # A worker that is being restarted is not in the list.
                killed.append(chance.choice(list(client.run(os.getpid, on_error="ignore").values())))
                os.kill(killed[-1], signal.SIGKILL)
    assert len(killed) == 4
    assert sorted(result.job.output for result in results) == sorted(job.output for job in jobs)
    assert [result.problem for result in results if result.problem] == []
    assert all(find_finished_result(job) for job in jobs)
    for character in ("horse", "man"):
        # All motions except one are the same walk, so all results are equal except for their names.
        measures = {
            tuple((name, value) for name, value in result.measures.items() if name != "bytes")
            for result in results
            if f"/{character}/walk" in Path(result.job.output).as_posix()
        }
        assert len(measures) == 1
    leftovers = [path for path in (library / "out").rglob("*") if path.is_file() and ".part" in path.name]
    assert len(leftovers) <= len(killed), "only the file that a killed worker was writing may remain"


@pytest.mark.slow
def test_results_in_the_memory_of_killed_workers_are_computed_again(library: Path) -> None:
    """Kills all workers after they have finished all jobs. At this time, only one result has been read."""
    jobs = _plan_pairs(library)
    with open_client(workers=2) as client:
        results = run_jobs(jobs, client)
        first_result = next(results)
        _wait_for_states(client, {"finished"})
        for process in client.run(os.getpid).values():
            os.kill(process, signal.SIGKILL)
        _wait_for_states(client, {"lost"})
        _check_that_all_succeeded(jobs, [first_result, *results])


@pytest.mark.slow
def test_result_that_is_lost_while_it_is_read_is_computed_again(
    library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kills both workers after the client has checked the state of the first future."""
    jobs = _plan_pairs(library)
    with open_client(workers=2) as client:
        gather, kills = client.gather, iter([True])

        def kill_and_gather(*arguments: Any, **options: Any) -> Any:
            for process in client.run(os.getpid).values() if next(kills, False) else ():
                os.kill(process, signal.SIGKILL)
            return gather(*arguments, **options)

        monkeypatch.setattr(client, "gather", kill_and_gather)
        _check_that_all_succeeded(jobs, list(run_jobs(jobs, client)))


@pytest.mark.slow
@pytest.mark.parametrize("submissions", [1, 2])
def test_cancelled_jobs_are_submitted_again_a_limited_number_of_times(
    library: Path, submissions: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Restarts the scheduler after the first result. This cancels the other three jobs."""
    monkeypatch.setattr(scheduler, "_MAX_SUBMISSIONS_PER_JOB", submissions)
    jobs = _plan_pairs(library)
    with open_client(workers=2) as client:
        results = run_jobs(jobs, client)
        first_result = next(results)
        client.restart()
        all_results = [first_result, *results]
    if submissions == 1:
        problems = [result.problem for result in all_results if result.problem]
        assert len(problems) == 3
        assert all(problem.startswith("the scheduler cancelled the job. ") for problem in problems)
    else:
        _check_that_all_succeeded(jobs, all_results)


@pytest.mark.slow
def test_a_scheduler_that_ends_during_a_batch_is_reported(
    library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ends a scheduler without workers while jobs wait at it."""
    monkeypatch.setattr(scheduler, "_CONNECT_TIMEOUT_S", 2.0)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1"]
    process = subprocess.Popen([*command, "--port", str(port), "--no-dashboard"], stderr=subprocess.DEVNULL)
    try:
        with _connect_when_ready(f"tcp://127.0.0.1:{port}") as client:
            threading.Timer(1.0, process.kill).start()
            with pytest.raises(EnlivenError, match="the connection to the Dask scheduler was lost"):
                list(run_jobs(_plan_pairs(library), client))
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def _connect_when_ready(address: str) -> Iterator[Client]:
    """Yields a client of a scheduler that is starting."""
    deadline = time.monotonic() + _MAX_WAIT_S
    with contextlib.ExitStack() as stack:
        while True:
            try:
                client = stack.enter_context(open_client(scheduler=address))
                break
            except EnlivenError:
                assert time.monotonic() < deadline
        yield client


def _plan_pairs(library: Path) -> list[BatchJob]:
    """Returns the four jobs of the library."""
    folders = (str(library / "motions"),), (str(library / "characters"),)
    return plan_jobs(BatchPlan(*folders, str(library / "out")))


def _wait_for_states(client: Client, states: set[str]) -> None:
    """Waits until the futures of all jobs are in the given states."""
    deadline = time.monotonic() + _MAX_WAIT_S
    while {future.status for future in client.futures.values()} != states:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def _check_that_all_succeeded(jobs: Sequence[BatchJob], results: Sequence[JobResult]) -> None:
    """Checks that each job has exactly one result, and that all results are complete."""
    assert [result.problem for result in results if result.problem] == []
    assert sorted(result.job.output for result in results) == sorted(job.output for job in jobs)
    assert all(find_finished_result(job) for job in jobs)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no process groups with signals")
def test_ctrl_c_ends_a_batch_without_a_traceback_and_the_next_run_continues(library: Path) -> None:
    """Sends SIGINT to all processes of the batch, as a terminal does, while jobs run."""
    walk = (library / "motions" / "walk.bvh").read_text()
    for number in range(98):
        (library / "motions" / f"walk-{number}.bvh").write_text(walk + "\n" * number)
    out = library / "out"
    arguments = ["--motions", library / "motions", "--characters", library / "characters", "-o", out]
    process = subprocess.Popen(
        [sys.executable, "-m", "enliven", "batch", *map(str, arguments), "--workers", "2"],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + _MAX_WAIT_S
    while not list(out.glob("*/.records/*.json")):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=_MAX_WAIT_S)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert "stopped early" in (out / "report.html").read_text(encoding="utf-8")
    plan = BatchPlan((str(library / "motions"),), (str(library / "characters"),), str(out))
    done = [job for job in plan_jobs(plan) if find_finished_result(job)]
    written = list(out.rglob("*.glb"))
    assert 0 < len(done) < 200
    assert len(written) - len(done) <= 2, "each worker may lack the record of one result"
    for path in written:
        read_gltf(path)  # Raises an error if the file is incomplete.


@pytest.mark.slow
def test_workers_with_another_current_folder_find_relative_paths(
    library: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(library)
    with open_client(workers=1) as client:
        client.run(os.chdir, "/")
        options = ["--motions", "motions", "--characters", "characters", "-o", "out"]
        assert run(["batch", *options, "--scheduler", client.scheduler.address]) == 0
    assert "4 pairs are in out (0 from earlier runs)" in capsys.readouterr().out
    assert len(list((library / "out").rglob("*.glb"))) == 4
    page = (library / "out" / "report.html").read_text(encoding="utf-8")
    assert 'href="horse/walk.glb"' in page


@pytest.mark.slow
def test_each_worker_uses_one_thread(library: Path) -> None:
    def count_threads() -> tuple[int, str | None]:
        import numba

        return numba.get_num_threads(), os.environ.get("OPENBLAS_NUM_THREADS")

    with open_client(workers=2) as client:
        assert list(client.run(count_threads).values()) == [(1, "1")] * 2


@pytest.mark.slow
def test_another_program_at_the_address_of_the_scheduler_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(EnlivenError, match="no Dask scheduler answers"), open_client(scheduler=address):
            pass


@pytest.mark.slow
def test_a_scheduler_that_is_absent_is_named() -> None:
    began = time.monotonic()
    with (
        pytest.raises(EnlivenError, match="no Dask scheduler answers"),
        open_client(scheduler="tcp://127.0.0.1:9"),
    ):
        pass
    assert time.monotonic() > began


def test_invalid_address_is_refused() -> None:
    with pytest.raises(EnlivenError), open_client(scheduler="nonsense://x"):
        pass
