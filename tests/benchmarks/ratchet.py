"""Compares bench.json with the committed headline figures, and prints a sentence for each figure that got
worse.

``.venv/bin/python tests/benchmarks/ratchet.py [--update]``. With ``--update``, values that got better are
stored.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
HEADLINES = HERE / "headlines.json"
"""The committed figures: a list of objects with the fields of :class:`Headline`."""
RESULT = HERE.parents[1] / "bench.json"
"""List of figures written by the benchmarks."""
DIRECTIONS = ("higher", "lower")


class BadHeadlines(Exception):
    """Raised for a file that cannot be read as figures. The message names the file and the correction."""


@dataclass(frozen=True)
class Headline:
    """A committed figure.

    Attributes:
        name: the name of the figure in bench.json.
        value: the best value so far in the figure's unit, None until the first ``--update``.
        better: "higher" or "lower", the direction that is better.
        tolerance: allowed difference by which a run may be worse than ``value``, in the figure's unit.
    """

    name: str
    value: float | None
    better: str
    tolerance: float

    @property
    def bound(self) -> float | None:
        """Returns the worst value that passes, None if there is no value yet."""
        if self.value is None:
            return None
        return self.value - self.tolerance if self.better == "higher" else self.value + self.tolerance

    def is_worse(self, measured: float) -> bool:
        """Returns True if a measured value is beyond the bound. This includes NaN."""
        if not math.isfinite(measured):
            return True
        if self.bound is None:
            return False
        return measured < self.bound if self.better == "higher" else measured > self.bound

    def is_improved(self, measured: float) -> bool:
        """Returns True if a measured value is better than the committed value, or is the first."""
        if not math.isfinite(measured):
            return False
        if self.value is None:
            return True
        return measured > self.value if self.better == "higher" else measured < self.value


def read_list(path: Path) -> list[dict[str, Any]]:
    """Returns the objects of a file of figures.

    Raises:
        BadHeadlines: if the file is missing or is not a list of objects with names.
    """
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadHeadlines(f"There is no {path}. Run the benchmarks first: make bench.") from None
    except (OSError, ValueError):
        raise BadHeadlines(f"{path} is not readable as JSON. Restore it, or measure again.") from None
    if not isinstance(rows, list) or not all(isinstance(row, dict) and "name" in row for row in rows):
        raise BadHeadlines(f"{path} is not a list of figures with names. Restore it, or measure again.")
    return rows


def read_headlines(path: Path) -> list[Headline]:
    """Returns the committed figures of a file.

    Raises:
        BadHeadlines: if a figure has other fields, no direction, or a negative tolerance.
    """
    headlines = []
    for row in read_list(path):
        if set(row) != {"name", "value", "better", "tolerance"}:
            raise BadHeadlines(
                f"{path}: {row['name']} needs name, value, better and tolerance, nothing else."
            )
        if row["better"] not in DIRECTIONS:
            raise BadHeadlines(f'{path}: {row["name"]} needs "higher" or "lower" as "better".')
        if not (isinstance(row["tolerance"], (int, float)) and row["tolerance"] >= 0):
            raise BadHeadlines(f"{path}: the tolerance of {row['name']} is not a number from 0 up.")
        if row["value"] is not None and not isinstance(row["value"], (int, float)):
            raise BadHeadlines(f"{path}: the value of {row['name']} is neither a number nor null.")
        headlines.append(Headline(**row))
    return headlines


def read_measured(path: Path) -> dict[str, float]:
    """Returns the values of bench.json by name. A value that is missing or not a number is NaN."""
    rows = read_list(path)
    numbers = (int, float)
    return {row["name"]: row["value"] if isinstance(row.get("value"), numbers) else math.nan for row in rows}


def find_complaints(headlines: Iterable[Headline], measured: Mapping[str, float]) -> list[str]:
    """Returns a sentence for each figure that got worse or was not measured."""
    sentences = []
    for headline in headlines:
        if headline.name not in measured:
            sentences.append(
                f"{headline.name} was not measured. Run: make bench ONLY={find_benchmark(headline.name)}."
            )
        elif headline.is_worse(measured[headline.name]):
            value = measured[headline.name]
            if headline.value is None or not math.isfinite(value):
                sentences.append(f"{headline.name} is {value}, which is not a figure.")
                continue
            word = "at least" if headline.better == "higher" else "at most"
            sentences.append(
                f"{headline.name} got worse: {value:.4g} instead of {headline.value:.4g}; "
                f"{word} {headline.bound:.4g} passes."
            )
    return sentences


def improve_figures(headlines: Iterable[Headline], measured: Mapping[str, float]) -> list[Headline]:
    """Returns the committed figures, updated with better values. Worse values change nothing."""
    return [
        replace(headline, value=measured[headline.name])
        if headline.name in measured and headline.is_improved(measured[headline.name])
        else headline
        for headline in headlines
    ]


def find_benchmark(name: str) -> str:
    """Returns the benchmark that measures a figure, which is the first word of its name."""
    return name.split(".")[0]


def main(arguments: Sequence[str]) -> int:
    """Returns the exit code: 1 if a figure got worse, 2 if a file cannot be read."""
    parser = argparse.ArgumentParser(prog="ratchet", description="Compare bench.json with committed figures.")
    parser.add_argument("--update", action="store_true", help="store values that got better")
    parser.add_argument("--measured", type=Path, default=RESULT, help="what the benchmarks wrote")
    parser.add_argument("--headlines", type=Path, default=HEADLINES, help="the committed figures")
    options = parser.parse_args(arguments)
    try:
        headlines, measured = read_headlines(options.headlines), read_measured(options.measured)
    except BadHeadlines as error:
        print(error, file=sys.stderr)
        return 2
    sentences = find_complaints(headlines, measured)
    for line in sentences:
        print(line)
    better = improve_figures(headlines, measured)
    changed = [new for new, old in zip(better, headlines, strict=True) if new != old]
    if options.update and changed:
        rows = ",\n".join(" " + json.dumps(asdict(headline)) for headline in better)
        options.headlines.write_text(f"[\n{rows}\n]\n", encoding="utf-8")
    for headline in changed:
        print(
            f"{headline.name} got better: {headline.value:.4g}"
            + ("" if options.update else "; --update stores it")
        )
    print(f"{len(headlines) - len(sentences)} of {len(headlines)} headline figures hold")
    return 1 if sentences else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
