"""Runs the jobs of a batch on Dask: on workers of this computer, or on a cluster of many.

    with open_client(workers=2) as client:
        for result in run_jobs(jobs, client):
            ...

If a worker crashes, no result is lost: other workers repeat its jobs. They also repeat a finished job if the
crashed worker had not delivered its result. A job's files are written completely or not at all. The same
code runs on one computer or on several computers with the same paths of files.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import os
import signal
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from enliven.batch.jobs import BatchJob, JobResult, find_finished_result, run_job
from enliven.errors import InputError, ResourceError, find_plain_reason
from enliven.supervision.lifetime import block_interrupts

if TYPE_CHECKING:
    from distributed import Client

log = logging.getLogger(__name__)

_MAX_ATTEMPTS_PER_JOB = 3
"""Maximum number of attempts for a job if its worker fails for an unknown reason."""
_MAX_SUBMISSIONS_PER_JOB = 3
"""Maximum number of submissions of a job that the scheduler cancels, for example because it was restarted."""
_UNFINISHED_STATES = ("lost", "pending")
"""States of a finished future after its worker ended with the result. The scheduler repeats the job."""
_MAX_WORKER_DEATHS = 10
"""Maximum number of workers that may crash during one job before the job counts as the cause. Workers may
also end for other reasons, such as lack of memory or a computer that is switched off.
"""
_JOBS_PER_WORKER = 50
"""Number of queued jobs per worker. More jobs would only use the scheduler's memory."""
_CONNECT_TIMEOUT_S = 8.0
"""Maximum time to connect to a scheduler, in seconds."""


@dataclass(frozen=True)
class _Submission:
    """A job that was submitted to the scheduler.

    Attributes:
        job: the job.
        number: 1 for the first submission of the job.
    """

    job: BatchJob
    number: int = 1


@contextlib.contextmanager
def open_client(workers: int = 0, scheduler: str = "") -> Iterator[Client]:
    """Yields a client of a cluster, and closes it at the end.

    Ctrl-C is blocked in the workers on this computer. Otherwise it would end them during a job, with a long
    error message.

    Args:
        workers: number of processes on this computer. 0 means one per processor core.
        scheduler: address of a Dask scheduler, such as "tcp://10.0.0.5:8786". If empty, a cluster is started
            that only programs on this computer can reach.

    Raises:
        ResourceError: if Dask is not installed, or the scheduler cannot be reached.
        InputError: if the address is invalid.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        remedy = 'Install it: pip install "enliven[batch]" (in a checkout: "./shared[batch]").'
        raise ResourceError("the library Dask is not installed", where="batch", remedy=remedy) from None
    settings = {
        "distributed.scheduler.allowed-failures": _MAX_WORKER_DEATHS,
        # Limit Numba and BLAS to one thread, because each job uses one core, and more threads would slow
        # other workers down.
        "distributed.nanny.environ": {"NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    }
    with dask.config.set(settings), contextlib.ExitStack() as stack:
        if scheduler:
            yield stack.enter_context(_connect(Client, scheduler))
            return
        _start_resource_tracker()
        with block_interrupts():
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=workers or os.cpu_count() or 1,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                )
            )
            client = stack.enter_context(Client(cluster))
        yield client


def _start_resource_tracker() -> None:
    """Starts the helper process of Python's multiprocessing now.

    Otherwise it would start with the first worker, and its start would unblock Ctrl-C for this worker.
    """
    if hasattr(signal, "pthread_sigmask"):
        from multiprocessing import resource_tracker

        resource_tracker.ensure_running()


def run_jobs(jobs: Sequence[BatchJob], client: Client) -> Iterator[JobResult]:
    """Yields the result of each job: first the results of earlier runs, then each new result when its job
    ends.

    Closing the iterator cancels the jobs that have not begun.

    Raises:
        ResourceError: if the connection to the scheduler is lost.
    """
    waiting = []
    for job in jobs:
        earlier_result = find_finished_result(job)
        if earlier_result is None:
            waiting.append(job)
        else:
            yield earlier_result
    yield from _run_on(client, waiting)


def _run_on(client: Client, jobs: Sequence[BatchJob]) -> Iterator[JobResult]:
    """Yields the result of each job. The number of jobs that are queued at the scheduler is limited.

    If a worker ends before its result has been read, the scheduler runs the job again. If the scheduler
    cancels a job, for example because it was restarted, the job is submitted again.

    Raises:
        ResourceError: if the connection to the scheduler is lost.
    """
    from distributed import as_completed

    queue = iter(jobs)
    limit = _JOBS_PER_WORKER * max(len(client.scheduler_info()["workers"]), 1)
    submissions: dict[object, _Submission] = {}
    completed = as_completed([], raise_errors=False)

    def submit(submission: _Submission) -> None:
        future = _submit(client, submission)
        submissions[future.key] = submission
        completed.add(future)

    try:
        for job in itertools.islice(queue, limit):
            submit(_Submission(job))
        for future in completed:
            if future.status in _UNFINISHED_STATES:
                completed.add(future)
                continue
            submission = submissions.pop(future.key)
            result = _read_result(future, client)
            if result is None and future.cancelled() and submission.number < _MAX_SUBMISSIONS_PER_JOB:
                submit(_Submission(submission.job, submission.number + 1))
                continue
            yield result or _describe_failure(future, submission.job)
            for job in itertools.islice(queue, 1):
                submit(_Submission(job))
    finally:
        if client.status == "running":
            client.cancel(completed.futures)


def _submit(client: Client, submission: _Submission) -> Any:
    """Submits a job and returns its future.

    Each submission has its own key. With the key of a cancelled job, the scheduler could cancel the new
    submission too.

    Raises:
        ResourceError: if the connection to the scheduler is lost.
    """
    if client.status not in ("running", "connecting"):
        raise ResourceError(
            "the connection to the Dask scheduler was lost",
            where="batch",
            remedy="Start the scheduler and repeat the command. The finished results are kept.",
        )
    job = submission.job
    return client.submit(
        run_job,
        job,
        key=f"enliven-{job.digest}-{job.output}-{submission.number}",
        retries=_MAX_ATTEMPTS_PER_JOB - 1,
        pure=False,
    )


def _read_result(future: Any, client: Client) -> JobResult | None:
    """Returns the result of a future, or None if the job failed unexpectedly or was cancelled.

    If the worker ends during this call, the call waits until another worker has repeated the job.
    """
    if future.status not in ("finished", *_UNFINISHED_STATES):
        return None
    results: list[JobResult] = client.gather([future], errors="skip")
    return results[0] if results else None


def _describe_failure(future: Any, job: BatchJob) -> JobResult:
    """Returns the result of a job that failed unexpectedly or was cancelled. Other jobs are not affected."""
    error = future.exception() if future.status == "error" else None
    reason = find_plain_reason(error) if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
    if type(error).__name__ == "KilledWorker":
        reason = f"{_MAX_WORKER_DEATHS} worker processes ended during this job. The computer may lack memory"
    elif error is None:
        reason = "the scheduler cancelled the job"
    log.error("%s failed unexpectedly: %s", job.name, reason)
    remedy = f"Run this job alone: enliven retarget {job.motion} {job.character} -o {job.output}"
    return JobResult(job, problem=f"{reason}. {remedy}")


async def _try_handshake(address: str) -> None:
    """Connects to a scheduler once with a timeout. Dask's client would wait forever if another program
    listens at the address."""
    from distributed import Security
    from distributed.comm import connect

    arguments = Security().get_connection_args("client")
    connection = await connect(address, timeout=_CONNECT_TIMEOUT_S, **arguments)
    await connection.close()


@contextlib.contextmanager
def _connect(client_type: type[Client], address: str) -> Iterator[Client]:
    """Yields a client of the scheduler at an address."""
    try:
        asyncio.run(asyncio.wait_for(_try_handshake(address), _CONNECT_TIMEOUT_S))
        client = client_type(address, timeout=_CONNECT_TIMEOUT_S)
    except (OSError, TimeoutError, EOFError, MemoryError) as error:
        reason = str(error) or f"no reply within {_CONNECT_TIMEOUT_S:g} s"
        remedy = (
            "Start the scheduler at this address: dask scheduler. Start a worker on each computer: dask "
            "worker ADDRESS --nthreads 1."
        )
        raise ResourceError(f"no Dask scheduler answers ({reason})", where=address, remedy=remedy) from None
    except ValueError as error:
        remedy = "Write the address as tcp://HOST:8786."
        raise InputError(
            f"the address of the scheduler is invalid ({error})", where=address, remedy=remedy
        ) from None
    with client:
        yield client
