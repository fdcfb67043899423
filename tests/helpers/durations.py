"""Reads and writes the table of durations of the longest test files. The table orders a test run."""

from collections.abc import Mapping
from pathlib import Path

TESTS = Path(__file__).parents[1]
TABLE = TESTS / "durations.txt"
"""Durations in seconds of the longest test files, measured in a complete run. The longest
are first.
"""
MIN_RECORDED_S = 5.0
"""Shortest duration in the table, seconds. The order of shorter files changes the end of a run by less than
this.
"""


def recorded_durations() -> dict[Path, float]:
    """Returns the seconds of each file of the table."""
    lines = (line.split(maxsplit=1) for line in TABLE.read_text(encoding="utf-8").splitlines())
    return {TESTS / name: float(seconds) for seconds, name in lines}


def table_of(taken: Mapping[str, float]) -> str:
    """Returns the text of the table.

    Args:
        taken: seconds of each test file, by its path relative to the checkout.
    """
    names = {name: Path(name).relative_to(TESTS.name).as_posix() for name in taken}
    long = sorted((-seconds, names[name]) for name, seconds in taken.items() if seconds >= MIN_RECORDED_S)
    return "".join(f"{-seconds:.0f} {name}\n" for seconds, name in long)
