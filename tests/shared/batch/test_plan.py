"""Tests of batch plans: files, names, options, and mistakes, which are all reported before any work."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from enliven.batch.jobs import run_job
from enliven.batch.plan import BatchPlan, create_plan_from_folders, load_plan, plan_jobs
from enliven.errors import EnlivenError, InputError, ResourceError


def _written(folder: Path, text: str) -> Path:
    path = folder / "plan.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_two_folders_make_a_job_for_each_pair(library: Path) -> None:
    plan = create_plan_from_folders(library / "motions", library / "characters")
    jobs = plan_jobs(BatchPlan(plan.motions, plan.characters, str(library / "out")))
    outputs = [str(Path(job.output).relative_to(library / "out")) for job in jobs]
    assert outputs == ["horse/run.glb", "horse/walk.glb", "man/run.glb", "man/walk.glb"]
    assert len({job.digest for job in jobs}) == 4


def test_paths_of_a_plan_are_relative_to_its_file(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (
        'version = 1\nmotions = ["motions/w*.bvh"]\ncharacters = ["characters"]\noutput = "results"\n'
        'format = "bvh"\n[options]\ntravel = true\n[heights]\n"horse.glb" = 1.5\n'
    )
    path = _written(library, text)
    monkeypatch.chdir("/")
    jobs = plan_jobs(load_plan(path))
    assert [Path(job.output) for job in jobs] == [
        library / "results" / f"{name}/walk.bvh" for name in ("horse", "man")
    ]
    assert [job.options["height"] for job in jobs] == [1.5, None]
    assert all(job.options["travel"] for job in jobs)


def test_all_missing_files_are_named_at_once(library: Path) -> None:
    text = (
        'motions = ["motions/walk.bvh", "motions/jump.bvh", "dances/*.bvh"]\n'
        'characters = ["characters/horse.glb", "characters/squid.glb"]\n'
        '[mappings]\nhorse = "horse-map.toml"\n[heights]\n"cow.glb" = 1.0\n'
    )
    with pytest.raises(InputError) as caught:
        plan_jobs(load_plan(_written(library, text)))
    for name in ("jump.bvh", "dances", "squid.glb", "horse-map.toml", "cow.glb"):
        assert name in str(caught.value)
    assert not (library / "out").exists(), "nothing is made before the plan is right"


def test_the_number_of_named_files_is_limited(library: Path) -> None:
    names = ", ".join(f'"none-{number}.bvh"' for number in range(500))
    with pytest.raises(InputError, match="and 480 more"):
        plan_jobs(load_plan(_written(library, f'motions = [{names}]\ncharacters = ["characters"]')))


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ('motions = ["motions"]', "has no characters"),
        ('characters = ["characters"]', "the plan has no motions"),
        ('motions = ["motions"]\ncharacters = ["characters"]\nformat = "fbx"', ".fbx cannot be written"),
        ('motion = ["motions"]', "did you mean motions"),
        ('motions = ["motions"]\ncharacters = ["characters"]\n[options]\nrate = 1000', "options.rate"),
        ("version = 99", "version"),
        ('motions = "motions"\ncharacters = ["characters"]', "expected a list in square brackets"),
        ("motions:\n  - walks\ncharacters:\n  - models", "at line 1"),
        (
            'motions = ["motions"]\ncharacters = ["characters"]\noutput = "a\\u0000b"',
            "file name is not valid",
        ),
        (
            'motions = ["motions"]\ncharacters = ["characters"]\n[heights]\nhorse = -1.0',
            "the height of horse",
        ),
        ('motions = ["empty"]\ncharacters = ["characters"]', "empty (this folder contains no .bvh"),
    ],
    ids=[
        "no characters",
        "no motions",
        "format",
        "key",
        "range",
        "later version",
        "no list",
        "YAML",
        "null byte",
        "height",
        "empty folder",
    ],
)
def test_mistakes_are_reported(library: Path, text: str, part: str) -> None:
    (library / "empty").mkdir()
    with pytest.raises(EnlivenError) as caught:
        plan_jobs(load_plan(_written(library, text)))
    assert part.lower() in str(caught.value).lower()


def test_equal_names_do_not_overwrite_each_other(library: Path) -> None:
    for folder in ("a", "b"):
        (library / folder).mkdir()
        (library / folder / "walk.bvh").write_bytes((library / "motions" / "walk.bvh").read_bytes())
    plan = BatchPlan(
        (str(library / "a"), str(library / "b")),
        (str(library / "characters" / "horse.glb"),),
        str(library / "out"),
    )
    outputs = [Path(job.output).name for job in plan_jobs(plan)]
    assert outputs == ["a-walk-bvh.glb", "b-walk-bvh.glb"]


def test_names_with_spaces_brackets_and_unicode_are_found(library: Path) -> None:
    folder = library / "Gång [1] 歩く"
    folder.mkdir()
    plan_file = _written(folder, 'motions = ["../motions/w*.bvh", "*.bvh"]\ncharacters = ["馬 *.glb"]')
    (folder / "två steg [2].bvh").write_bytes((library / "motions" / "walk.bvh").read_bytes())
    (folder / "馬 #1.glb").write_bytes((library / "characters" / "horse.glb").read_bytes())
    outputs = [Path(job.output) for job in plan_jobs(load_plan(plan_file))]
    assert outputs == [
        folder / "out" / "batch" / "馬 #1" / f"{name}.glb" for name in ("walk", "två steg [2]")
    ]


@pytest.mark.parametrize("output", ["motions", "motions/out"])
def test_results_in_the_folder_of_motions_are_not_motions(library: Path, output: str) -> None:
    plan = BatchPlan((str(library / "motions"),), (str(library / "characters"),), str(library / output))
    jobs = plan_jobs(plan)
    assert run_job(jobs[0]).problem == ""
    assert plan_jobs(plan) == jobs
    # Another batch may read them as motions.
    next_plan = replace(plan, output=str(library / "next"))
    assert len(plan_jobs(next_plan)) == len(jobs) + 2


@pytest.mark.parametrize("output", ["file", "file/below"])
def test_a_file_in_the_place_of_the_output_folder_is_named(library: Path, output: str) -> None:
    (library / "file").write_text("taken")
    plan = BatchPlan((str(library / "motions"),), (str(library / "characters"),), str(library / output))
    with pytest.raises(ResourceError, match="a folder above it is a file") as caught:
        plan_jobs(plan)
    assert str(library / output) in str(caught.value)


def test_text_files_count_only_if_they_hold_numbers(library: Path) -> None:
    (library / "motions" / "cmu.txt").write_text("0.0 1.5 -2.0\n0.1 1.5 -2.0\n")
    plan = BatchPlan((str(library / "motions"),), (str(library / "characters"),), str(library / "out"))
    assert {Path(job.motion).name for job in plan_jobs(plan)} == {"walk.bvh", "run.bvh", "cmu.txt"}


def test_the_plan_of_the_documentation_is_a_plan(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "batch.md").read_text(encoding="utf-8")
    block = page.partition("```toml")[2].partition("```")[0]
    plan = load_plan(_written(tmp_path, block))
    assert plan.options.pin
    assert plan.heights == {"horse.glb": 1.6}
    assert plan.mappings["horse.glb"].endswith("maps/horse.toml")
