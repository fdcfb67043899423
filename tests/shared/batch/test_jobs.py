"""Jobs of batches: results, records, and changes that make a result outdated."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from enliven.batch.jobs import BatchJob, find_finished_result, run_job
from enliven.batch.plan import BatchPlan, plan_jobs
from enliven.batch.report import write_report
from enliven.formats.gltf.read import read_gltf
from enliven.oneshot.retargeting import RetargetOptions


def _first_job(library: Path, options: RetargetOptions | None = None) -> BatchJob:
    motion, character = library / "motions" / "walk.bvh", library / "characters" / "horse.glb"
    plan = BatchPlan(
        (str(motion),), (str(character),), str(library / "out"), options=options or RetargetOptions()
    )
    return plan_jobs(plan)[0]


def test_a_job_writes_what_retarget_writes_and_is_then_done(library: Path) -> None:
    job = _first_job(library)
    assert find_finished_result(job) is None
    result = run_job(job)
    assert (result.problem, result.is_new) == ("", True)
    assert result.measures["seconds"] == pytest.approx(0.55)
    assert read_gltf(job.output).clips[0].id == "walk on horse"
    again = find_finished_result(_first_job(library))
    assert again is not None
    assert (again.output_digest, again.is_new, again.measures) == (
        result.output_digest,
        False,
        result.measures,
    )


def test_a_changed_file_or_option_makes_another_job(library: Path) -> None:
    before = _first_job(library)
    run_job(before)
    assert find_finished_result(_first_job(library, RetargetOptions(travel=True))) is None
    motion = library / "motions" / "walk.bvh"
    motion.write_bytes(motion.read_bytes().replace(b"Frame Time: 0.05", b"Frame Time: 0.06") + b"\n")
    assert _first_job(library).digest != before.digest


@pytest.mark.parametrize("damage", ["cut result", "no result", "cut record", "other record"])
def test_a_damaged_result_or_record_is_done_again(library: Path, damage: str) -> None:
    job = _first_job(library)
    run_job(job)
    output = Path(job.output)
    if damage == "cut result":
        output.write_bytes(output.read_bytes()[:-1])
    elif damage == "no result":
        output.unlink()
    else:
        job.record.write_bytes(job.record.read_bytes()[:20] if damage == "cut record" else b"[]")
    assert find_finished_result(job) is None
    assert run_job(job).problem == ""
    assert find_finished_result(job) is not None


def test_a_failure_has_its_reason_and_leaves_no_file(library: Path) -> None:
    (library / "characters" / "horse.glb").write_bytes(b"broken")
    result = run_job(_first_job(library))
    assert "horse.glb" in result.problem
    assert result.output_digest == ""
    assert not (library / "out" / "horse").exists()


def test_a_job_survives_the_way_to_a_worker(library: Path) -> None:
    job = _first_job(library, RetargetOptions(rest="0.1", height=2.0))
    received = msgspec.json.decode(msgspec.json.encode(job), type=BatchJob)
    assert received == job
    assert run_job(received).problem == ""


def test_the_report_names_failures_first_and_escapes_names(library: Path) -> None:
    good = run_job(_first_job(library))
    hostile = msgspec.structs.replace(good.job, motion="/x/<script>alert(1)</script>.bvh")
    failed = msgspec.structs.replace(
        good, job=hostile, output_digest="", problem="it is <b>damaged</b>. Export it again."
    )
    report = library / "out" / "report.html"
    write_report(report, [good, failed], 3, running=True)
    page = report.read_text(encoding="utf-8")
    assert "<script>" not in page
    assert "it is &lt;b&gt;damaged" in page
    assert page.index("damaged") < page.index("horse/walk.glb")
    assert "2 of 3 pairs, running" in page
    assert 'http-equiv="refresh"' in page
    write_report(report, [good, failed], 3)
    assert "stopped before its end" in report.read_text(encoding="utf-8")
