"""The command ``enliven batch``: retargets every motion of a plan to every character, in parallel."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.terminal import print_line, progress_lines
from enliven.errors import InputError
from enliven.supervision.lifetime import terminate_as_interrupt

if TYPE_CHECKING:
    from enliven.batch.jobs import BatchJob, JobResult
    from enliven.batch.plan import BatchPlan

_REPORT_INTERVAL_S = 5.0
"""Minimum interval, in seconds, at which the report of a running batch is written. A report of 10,000 pairs
has 5 MB."""


def batch(
    plan: Annotated[
        Path | None,
        typer.Argument(
            help="Plan of the batch (TOML file). Instead of a plan, --motions and --characters can be used."
        ),
    ] = None,
    motions: Annotated[
        Path | None,
        typer.Option(help="Folder with the motion files. Use it with --characters instead of a plan."),
    ] = None,
    characters: Annotated[
        Path | None,
        typer.Option(help="Folder with the character files. Use it with --motions instead of a plan."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder for the results. Default: the folder in the plan."),
    ] = None,
    format: Annotated[
        str | None, typer.Option(help="File format of the results, such as glb or bvh.")
    ] = None,
    sheets: Annotated[
        bool,
        typer.Option("--sheets", help="Draw a contact sheet of each result (needs the viewer's package)."),
    ] = False,
    travel: Annotated[
        bool, typer.Option("--travel", help="Move the characters through space along the performers' paths.")
    ] = False,
    pin: Annotated[
        bool, typer.Option("--pin", help="With --travel: lock standing feet, so that they do not slide.")
    ] = False,
    workers: Annotated[
        int,
        typer.Option(min=0, help="Number of worker processes on this computer. 0: one per processor core."),
    ] = 0,
    scheduler: Annotated[
        str,
        typer.Option(
            help=(
                "Address of a Dask scheduler that distributes the work to many computers, such as "
                "tcp://10.0.0.5:8786."
            )
        ),
    ] = "",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check the plan and list the work, but write nothing.")
    ] = False,
) -> None:
    """Retarget every motion onto every character. Another run writes only missing results.

    The results are OUTPUT/CHARACTER/MOTION.glb. The page OUTPUT/report.html lists the results with their
    quality and the reasons of failures, and shows the progress while the batch runs. docs/batch.md describes
    the plan file.

    \b
      enliven batch --motions WALKS --characters MODELS -o out/walks
      enliven batch PLAN.toml
      enliven batch PLAN.toml --scheduler tcp://10.0.0.5:8786
    """
    # Import large modules only here, so that `--help` is fast.
    from enliven.batch.jobs import find_finished_result
    from enliven.batch.plan import plan_jobs

    chosen_plan = _load_or_make_plan(plan, motions, characters, output, format)
    options = replace(
        chosen_plan.options, travel=travel or chosen_plan.options.travel, pin=pin or chosen_plan.options.pin
    )
    chosen_plan = replace(chosen_plan, options=options, sheets=sheets or chosen_plan.sheets)
    jobs = plan_jobs(chosen_plan)
    if dry_run:
        for job in jobs:
            print_line(f"{'done' if find_finished_result(job) else 'to do'}: {job.name}: {job.output}")
        return
    failed = _run(jobs, Path(chosen_plan.output) / "report.html", workers, scheduler)
    if failed:
        raise typer.Exit(1)


def _load_or_make_plan(
    plan: Path | None,
    motions: Path | None,
    characters: Path | None,
    output: Path | None,
    format: str | None,
) -> BatchPlan:
    """Returns the plan from a file or from two folders. Values on the command line take precedence."""
    from enliven.batch.plan import create_plan_from_folders, load_plan

    if plan is not None:
        if motions or characters:
            raise InputError(
                "both a plan and folders were given",
                where="batch",
                remedy="Leave out --motions and --characters, or leave out the plan.",
            )
        return _with_output(load_plan(plan), output, format)
    if motions is None or characters is None:
        remedy = "Pass a plan file, or --motions FOLDER and --characters FOLDER."
        raise InputError("neither a plan nor both folders were given", where="batch", remedy=remedy)
    return _with_output(create_plan_from_folders(motions, characters), output, format)


def _with_output(plan: BatchPlan, output: Path | None, format: str | None) -> BatchPlan:
    """Returns the plan with another output folder or format, if given."""
    return replace(
        plan,
        output=str(output) if output else plan.output,
        format=format.removeprefix(".") if format else plan.format,
    )


def _run(jobs: Sequence[BatchJob], report: Path, workers: int, scheduler: str) -> int:
    """Runs the jobs with a progress bar, and updates the report. Returns the number of failed jobs."""
    from enliven.batch.report import write_report
    from enliven.batch.scheduler import open_client, run_jobs

    if scheduler:
        jobs = [job.with_absolute_paths() for job in jobs]
    results: list[JobResult] = []
    written_at = time.monotonic()
    with contextlib.ExitStack() as stack:
        stack.enter_context(terminate_as_interrupt())
        client = stack.enter_context(open_client(workers, scheduler))
        print_line(
            f"enliven: retargeting {len(jobs)} pair{'s' * (len(jobs) != 1)} of a motion and a "
            f"character; {report} shows the progress",
            err=True,
        )
        if not client.scheduler_info()["workers"]:
            print_line(
                f"enliven: the scheduler {scheduler} has no workers yet. Run this command on each "
                f"computer: dask worker {scheduler} --nthreads 1",
                err=True,
            )
        display = stack.enter_context(
            progress_lines("{task.description}", "{task.completed:.0f} of {task.total:.0f}", bar=True)
        )
        task = display.add_task("retargeting", total=len(jobs))
        write_report(report, results, len(jobs), running=True)
        try:
            for result in run_jobs(jobs, client):
                results.append(result)
                display.update(task, completed=len(results))
                if result.problem:
                    print_line(f"enliven: {result.job.name}: {result.problem}", err=True)
                if time.monotonic() - written_at > _REPORT_INTERVAL_S:
                    write_report(report, results, len(jobs), running=True)
                    written_at = time.monotonic()
        finally:
            write_report(report, results, len(jobs))
    failed, earlier_count = sum(bool(r.problem) for r in results), sum(not r.is_new for r in results)
    faulty, written = sum(bool(r.faults) for r in results), len(results) - failed
    print_line(
        f"enliven: {written} pair{' is' if written == 1 else 's are'} in {report.parent} "
        f"({earlier_count} from earlier runs). {faulty} have visible faults, {failed} failed. "
        f"Report: {report}"
    )
    return failed
