"""Tests of batch jobs: results, records, and changes that make a result outdated."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from enliven.batch import jobs
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


def test_changed_file_or_option_makes_a_new_job(library: Path) -> None:
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
        job.record_path.write_bytes(job.record_path.read_bytes()[:20] if damage == "cut record" else b"[]")
    assert find_finished_result(job) is None
    assert run_job(job).problem == ""
    assert find_finished_result(job) is not None


def test_a_failure_has_its_reason_and_leaves_no_file(library: Path) -> None:
    (library / "characters" / "horse.glb").write_bytes(b"broken")
    result = run_job(_first_job(library))
    assert "horse.glb" in result.problem
    assert result.output_digest == ""
    assert not (library / "out" / "horse").exists()


@pytest.mark.parametrize("place", ["horse", "horse/.records", "horse/walk.glb/below"])
def test_a_file_or_folder_in_the_place_of_a_result_is_named(library: Path, place: str) -> None:
    job = _first_job(library)
    obstacle = library / "out" / place
    obstacle.parent.mkdir(parents=True, exist_ok=True)
    obstacle.write_text("taken")
    result = run_job(job)
    assert str(library / "out" / "horse") in result.problem
    assert "Move the file" in result.problem or "Choose another output file" in result.problem
    assert obstacle.read_text() == "taken"
    assert find_finished_result(job) is None


def test_results_of_another_version_are_made_again(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as installation:
        installation.setattr(jobs, "version", lambda name: "0.0.1")
        earlier = _first_job(library)
        run_job(earlier)
        assert find_finished_result(_first_job(library)) is not None
    job = _first_job(library)
    assert find_finished_result(job) is None
    assert run_job(job).problem == ""
    assert find_finished_result(job) is not None


def test_a_motion_of_one_frame_is_retargeted(library: Path) -> None:
    motion = library / "motions" / "walk.bvh"
    head, _, rows = motion.read_text().partition("Frames: 12")
    interval, first_row = rows.strip().splitlines()[:2]
    motion.write_text(f"{head}Frames: 1\n{interval}\n{first_row}\n")
    result = run_job(_first_job(library, RetargetOptions(travel=True, pin=True)))
    assert (result.problem, result.measures["seconds"]) == ("", 0.0)


def test_an_empty_file_is_named(library: Path) -> None:
    for path in (library / "motions" / "walk.bvh", library / "characters" / "horse.glb"):
        content = path.read_bytes()
        path.write_bytes(b"")
        assert path.name in run_job(_first_job(library)).problem
        path.write_bytes(content)


def test_a_deleted_character_is_named_even_if_it_was_read_before(library: Path) -> None:
    job = _first_job(library)
    run_job(job)
    Path(job.character).unlink()
    assert "horse.glb: the file does not exist" in run_job(job).problem


def test_a_changed_character_is_read_again(library: Path) -> None:
    first = run_job(_first_job(library))
    character = library / "characters" / "horse.glb"
    character.write_bytes((library / "characters" / "man.glb").read_bytes())
    changed = run_job(_first_job(library))
    assert changed.problem == ""
    assert changed.output_digest != first.output_digest
    taller = run_job(_first_job(library, RetargetOptions(height=3.0)))
    assert len({first.output_digest, changed.output_digest, taller.output_digest}) == 3


def test_a_job_with_relative_paths_becomes_absolute(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(library)
    plan = BatchPlan(("motions/walk.bvh",), ("characters/horse.glb",), "out")
    (job,) = plan_jobs(plan)
    monkeypatch.chdir("/")
    assert "the file does not exist" in run_job(job).problem
    monkeypatch.chdir(library)
    absolute = job.with_absolute_paths()
    monkeypatch.chdir("/")
    assert run_job(absolute).problem == ""
    assert (library / "out" / "horse" / "walk.glb").is_file()


def test_job_survives_serialisation(library: Path) -> None:
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
    assert "stopped early" in report.read_text(encoding="utf-8")
