"""Tests of the ratchet of headline figures with synthetic files, and of the order of the nightly steps."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import nightly  # noqa: E402
import ratchet  # noqa: E402
from figure import Figure  # noqa: E402

COMMITTED = [
    {"name": "road.fps", "value": 100.0, "better": "higher", "tolerance": 5.0},
    {"name": "road.ms", "value": 8.0, "better": "lower", "tolerance": 0.5},
    {"name": "tracking.swaps", "value": 0.0, "better": "lower", "tolerance": 0.0},
    {"name": "scanning.mm", "value": None, "better": "lower", "tolerance": 0.1},
]
SAME = {"road.fps": 100.0, "road.ms": 8.0, "tracking.swaps": 0.0, "scanning.mm": 1.5}


@pytest.fixture
def check(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Returns a function that runs the ratchet on measured values. It returns exit code, printed lines, and
    the stored figures.
    """
    headlines, bench = tmp_path / "headlines.json", tmp_path / "bench.json"
    headlines.write_text(json.dumps(COMMITTED))

    def run(measured: dict[str, float], *words: str) -> tuple[int, list[str], dict[str, float | None]]:
        bench.write_text(json.dumps([vars(Figure(name, value, "mm")) for name, value in measured.items()]))
        code = ratchet.main(["--headlines", str(headlines), "--measured", str(bench), *words])
        kept = {row["name"]: row["value"] for row in json.loads(headlines.read_text())}
        return code, capsys.readouterr().out.splitlines(), kept

    return run


def test_figures_within_their_tolerance_pass(check) -> None:
    code, lines, kept = check({**SAME, "road.fps": 95.0, "road.ms": 8.5})
    assert code == 0 and lines[-1] == "4 of 4 headline figures hold"
    assert kept["road.fps"] == 100.0, "a check alone stores nothing"


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("road.fps", 94.9, "road.fps got worse: 94.9 instead of 100; at least 95 passes."),
        ("road.ms", 8.51, "road.ms got worse: 8.51 instead of 8; at most 8.5 passes."),
        ("tracking.swaps", 0.1, "tracking.swaps got worse: 0.1 instead of 0; at most 0 passes."),
        ("road.fps", float("nan"), "road.fps is nan, which is not a figure."),
        ("scanning.mm", float("inf"), "scanning.mm is inf, which is not a figure."),
    ],
)
def test_a_worse_figure_fails_with_one_sentence(check, name, value, sentence) -> None:
    code, lines, _ = check({**SAME, name: value})
    assert code == 1 and lines[0] == sentence
    assert lines[-1] == "3 of 4 headline figures hold"


def test_each_worse_figure_has_its_sentence(check) -> None:
    code, lines, _ = check({"road.fps": 1.0, "road.ms": 99.0, "tracking.swaps": 3.0, "scanning.mm": 1.0})
    assert code == 1 and sum("got worse" in line for line in lines) == 3


def test_a_figure_that_was_not_measured_fails(check) -> None:
    code, lines, _ = check({name: value for name, value in SAME.items() if name != "road.ms"})
    assert code == 1 and lines[0] == "road.ms was not measured. Run: make bench ONLY=road."


def test_update_stores_better_values_and_never_worse_ones(check) -> None:
    code, lines, kept = check({**SAME, "road.fps": 120.0, "road.ms": 8.4}, "--update")
    assert code == 0 and "road.fps got better: 120" in lines
    assert kept == {"road.fps": 120.0, "road.ms": 8.0, "tracking.swaps": 0.0, "scanning.mm": 1.5}
    code, lines, kept = check({**SAME, "road.fps": 110.0}, "--update")
    assert code == 1 and kept["road.fps"] == 120.0, "what was once reached has to be kept"
    assert lines[0] == "road.fps got worse: 110 instead of 120; at least 115 passes."


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "not readable as JSON"),
        ("{}", "not a list of figures"),
        ('[{"name": "a", "value": 1, "better": "more", "tolerance": 0}]', '"higher" or "lower"'),
        ('[{"name": "a", "value": 1, "better": "lower", "tolerance": -1}]', "tolerance of a"),
        ('[{"name": "a", "value": "1", "better": "lower", "tolerance": 1}]', "value of a"),
        ('[{"name": "a", "value": 1}]', "a needs name, value, better and tolerance"),
        (None, "Run the benchmarks first"),
    ],
)
def test_a_file_that_is_not_one_of_figures_is_refused(tmp_path, capsys, text, words) -> None:
    path = tmp_path / "headlines.json"
    if text is not None:
        path.write_text(text)
    assert ratchet.main(["--headlines", str(path), "--measured", str(path)]) == 2
    assert words in capsys.readouterr().err


def test_the_committed_figures_are_measured_by_benchmarks() -> None:
    headlines = ratchet.read_headlines(ratchet.HEADLINES)
    assert len(headlines) > 20 and len({headline.name for headline in headlines}) == len(headlines)
    sources = "\n".join(path.read_text(encoding="utf-8") for path in HERE.rglob("*.py"))
    for headline in headlines:
        assert (HERE / f"bench_{ratchet.find_benchmark(headline.name)}.py").is_file(), headline.name
        assert headline.name.rsplit(".", 1)[1] in sources, headline.name


def test_a_night_forgets_older_figures_and_runs_each_step(tmp_path) -> None:
    bench = tmp_path / "bench.json"
    bench.write_text(json.dumps([vars(Figure(name, 1.0, "mm")) for name in ("road.fps", "arap.ms")]))
    nightly.forget(bench, ["road"])
    assert [row["name"] for row in json.loads(bench.read_text())] == ["arap.ms"]
    ran = []

    def run(command: list[str]) -> int:
        ran.append(command)
        return 3 if command[:2] == ["make", "fuzz"] else 0

    commands = nightly.list_steps(True, ["road"])
    failed = nightly.run_all(commands, run)
    assert ran == list(commands.values()) and ran[-1][-1] == "--update"
    assert failed == ["nightly: fuzzing failed with exit code 3: make fuzz SECONDS=600"]
    listed = subprocess.run(["make", "-n", "nightly"], cwd=HERE.parents[1], capture_output=True, text=True)
    assert "tests/benchmarks/nightly.py" in listed.stdout
