"""Fuzzes readers for a given time: `make fuzz SECONDS=600 SEED=7 ONLY=gltf`.

The search is guided by coverage if atheris is installed (fuzz_guided.py). Otherwise, each file is a random
mutation of a seed. The first line names the kind of search.

Everything is stored in out/fuzz: files that break a reader, the corpus that the search has found, and
totals.json with the executions of all runs.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), *(str(HERE.parent / "shared" / room) for room in ("formats", "modeling"))]
sys.path.insert(0, str(HERE.parent / "helpers"))
import fuzz_corpus  # noqa: E402
import fuzz_guided  # noqa: E402
import fuzz_law  # noqa: E402
import fuzz_readers  # noqa: E402

BATCH = 20
"""Without atheris, number of files per reader before the next reader's turn."""
MIN_TURN_S, MAX_TURN_S = 2.0, 60.0
"""Range of the duration of a reader's turn, seconds. Starting a turn takes 0.2 s."""
OUT = Path("out/fuzz")


def main(arguments: list[str]) -> int:
    """Returns the exit code: 1 if a reader broke the rule. Every file that breaks a reader is kept in
    out/fuzz."""
    options = _parse(arguments)
    OUT.mkdir(parents=True, exist_ok=True)
    if options.repeat:
        return repeat(Path(options.repeat))
    targets = [target for target in fuzz_readers.targets() if options.only in target.name]
    if not targets:
        print(f"no reader is called {options.only!r}")
        return 2
    executions, broken = fuzz(targets, options.seconds, options.seed)
    print(f"{executions:,} files and messages, {broken} new faults (SEED={options.seed})")
    return 1 if broken else 0


def fuzz(targets: list[fuzz_law.Target], seconds: float, seed: int) -> tuple[int, int]:
    """Fuzzes the readers. Returns the numbers of executions and of new faults."""
    try:
        count = fuzz_guided.instrument()
        kind, run = f"guided by the coverage of {count} functions (atheris)", _guided
    except fuzz_guided.NotInstalledError:
        kind, run = "random mutations (atheris is not installed)", _random
    print(f"SEED={seed}, {seconds:g} s, {len(targets)} readers, {kind}", flush=True)
    executions: dict[str, int] = {}
    broken = 0
    end = time.monotonic() + seconds
    with fuzz_law.room() as room:
        for name, count, faults in run(targets, seconds, seed, Path(room)):
            executions[name] = executions.get(name, 0) + count
            broken += len(faults)
            for fault in faults:
                print(f"{fault}\n  to repeat it: make fuzz REPEAT={fault.rpartition(' ')[2]}", flush=True)
            _add_to_totals(name, count)
            if time.monotonic() > end:
                break
    return sum(executions.values()), broken


def repeat(path: Path) -> int:
    """Reads a stored file again. If it still breaks its reader, prints the traceback and returns 1."""
    matches = [t for t in fuzz_readers.targets() if path.name.startswith(f"broken-{t.slug}-")]
    if not matches:
        print(f"{path.name} names no reader; a kept file is called broken-READER-NUMBER.bin")
        return 2
    target = max(matches, key=lambda t: len(t.slug))
    with fuzz_law.room() as room:
        try:
            fuzz_law.check_bytes(target, path.read_bytes(), Path(room), OUT)
        except fuzz_law.Broken as error:
            traceback.print_exception(error.__cause__)
            print(error)
            return 1
    print(f"{target.name}: read, or refused as it may be")
    return 0


def _guided(
    targets: list[fuzz_law.Target], seconds: float, seed: int, room: Path
) -> Iterator[tuple[str, int, list[str]]]:
    """Yields (name, executions, new faults) of each turn, endlessly."""
    turn_s = min(max(seconds / len(targets), MIN_TURN_S), MAX_TURN_S)
    for target in targets:
        fuzz_corpus.write_seeds(target, OUT / "corpus")
    for number in itertools.count():
        for target in targets:
            folders = [OUT / "corpus" / target.slug]
            turn = fuzz_guided.take_turn(target, turn_s, seed + number, folders, room, OUT)
            print(
                f"{target.name}: {turn.executions} in {turn_s:g} s, slowest {turn.slowest_s:.2g} s",
                flush=True,
            )
            yield target.name, turn.executions, turn.broken


def _random(
    targets: list[fuzz_law.Target], seconds: float, seed: int, room: Path
) -> Iterator[tuple[str, int, list[str]]]:
    """Yields (name, executions, new faults) of each batch, endlessly."""
    for batch in itertools.count():
        for target in targets:
            faults = []
            for number in range(batch * BATCH, (batch + 1) * BATCH):
                try:
                    fuzz_law.check(target, f"{seed}-{number}", room, OUT)
                except fuzz_law.Broken as error:
                    faults += [str(error)] if error.is_new else []
            yield target.name, BATCH, faults


def _add_to_totals(name: str, count: int) -> None:
    """Adds a number of executions to the totals of all runs."""
    path = OUT / "totals.json"
    totals = json.loads(path.read_text()) if path.exists() else {}
    totals[name] = totals.get(name, 0) + count
    path.write_text(json.dumps(totals, indent=1) + "\n")


def _parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=time.time_ns() % 1_000_000)
    parser.add_argument("--only", default="", help="a part of the name of a reader")
    parser.add_argument("--repeat", default="", help="a kept file")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
