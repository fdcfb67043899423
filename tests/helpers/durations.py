"""The table of how long the longest test files take, which orders a run."""

from collections.abc import Mapping
from pathlib import Path

TESTS = Path(__file__).parents[1]
TABLE = TESTS / "durations.txt"
"""Seconds that each of the longest files took in a whole run of three processes, the longest first."""
MIN_RECORDED_S = 5.0
"""Shortest file in the table, seconds: the order of shorter ones moves the end of a run by less than that."""


def recorded_durations() -> dict[Path, float]:
    """Returns the seconds of each file of the table."""
    lines = (line.split(maxsplit=1) for line in TABLE.read_text(encoding="utf-8").splitlines())
    return {TESTS / name: float(seconds) for seconds, name in lines}


def table_of(taken: Mapping[str, float]) -> str:
    """Returns the text of the table for the seconds of each file of a run, by paths from the checkout."""
    names = {name: Path(name).relative_to(TESTS.name).as_posix() for name in taken}
    long = sorted((-seconds, names[name]) for name, seconds in taken.items() if seconds >= MIN_RECORDED_S)
    return "".join(f"{-seconds:.0f} {name}\n" for seconds, name in long)
