"""Plans of batches: files, names, options, and mistakes that are all named before any work."""

from __future__ import annotations

from pathlib import Path

import pytest

from enliven.batch.plan import BatchPlan, load_plan, plan_jobs, plan_of
from enliven.errors import EnlivenError, InputError


def _written(folder: Path, text: str) -> Path:
    path = folder / "plan.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_two_folders_make_a_job_for_each_pair(library: Path) -> None:
    plan = plan_of(library / "motions", library / "characters")
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
        ('characters = ["characters"]', "has no motions"),
        ('motions = ["motions"]\ncharacters = ["characters"]\nformat = "fbx"', ".fbx cannot be written"),
        ('motion = ["motions"]', "did you mean motions"),
        ('motions = ["motions"]\ncharacters = ["characters"]\n[options]\nrate = 1000', "options.rate"),
        ("version = 99", "version"),
    ],
    ids=["no characters", "no motions", "format", "key", "range", "later version"],
)
def test_a_mistake_is_named(library: Path, text: str, part: str) -> None:
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
