"""Reads random mutated files for a given time: `make fuzz SECONDS=600 SEED=7 ONLY=gltf`."""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), *(str(HERE.parent / "shared" / room) for room in ("formats", "modeling"))]
sys.path.insert(0, str(HERE.parent / "helpers"))
import fuzz_law  # noqa: E402
import fuzz_readers  # noqa: E402

BATCH = 20
"""Number of files per reader before the next reader's turn."""


def main() -> int:
    """Returns the exit code: 1 if a reader broke the rule. Every file that breaks a reader is kept in
    out/fuzz."""
    arguments = dict(enumerate(sys.argv[1:]))
    seconds = float(arguments.get(0) or 60)
    seed = arguments.get(1) or str(time.time_ns() % 1_000_000)
    only = arguments.get(2) or ""
    kept = Path("out/fuzz")
    kept.mkdir(parents=True, exist_ok=True)
    targets = [target for target in fuzz_readers.targets() if only in target.name]
    if not targets:
        print(f"no reader is called {only!r}")
        return 2
    print(f"SEED={seed}, {seconds:g} s, {len(targets)} readers", flush=True)
    end, done, broken = time.monotonic() + seconds, 0, 0
    with fuzz_law.room() as folder:
        for target, number in _turns(targets):
            if time.monotonic() > end:
                break
            done += 1
            try:
                fuzz_law.check(target, f"{seed}-{number}", Path(folder), kept)
            except fuzz_law.Broken as error:
                broken += 1
                print(error, flush=True)
    print(f"{done} files, {broken} broke a reader (SEED={seed})")
    return 1 if broken else 0


def _turns(targets: list[fuzz_law.Target]) -> Iterator[tuple[fuzz_law.Target, int]]:
    """Yields readers and the numbers of their files, endlessly."""
    for batch in itertools.count():
        for target in targets:
            yield from ((target, number) for number in range(batch * BATCH, (batch + 1) * BATCH))


if __name__ == "__main__":
    sys.exit(main())
