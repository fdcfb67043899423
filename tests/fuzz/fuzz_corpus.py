"""The corpus: inputs that reach different code, found by `make fuzz`. The repository contains a small part.

    .venv/bin/python tests/fuzz/fuzz_corpus.py     # choose that part again, from out/fuzz/corpus

All inputs are mutations of files and messages made by enliven's own code. Every test run reads them.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

HERE = Path(__file__).parent
if __name__ == "__main__":
    sys.path[:0] = [str(HERE), *(str(HERE.parent / "shared" / room) for room in ("formats", "modeling"))]
    sys.path.insert(0, str(HERE.parent / "helpers"))

import fuzz_law  # noqa: E402
from fuzz_law import Target  # noqa: E402

CORPUS = HERE / "corpus"
"""The folder that contains a subfolder for each reader."""
MAX_READER_BYTES = 6000
"""Maximum size of the stored corpus of one reader, bytes. All readers together have about 200 kB."""
MAX_INPUT_BYTES = 3000
"""Maximum size of one stored input, bytes."""
CODE = tuple(str(HERE.parents[1] / part / "enliven") for part in ("shared", "edge", "viewer"))
"""Path prefixes of the code whose lines are counted."""
REGRESSION = "fault"
"""Prefix of the names of inputs that once broke a reader. They are always kept."""


def stored(target: Target) -> list[Path]:
    """Returns the inputs of a reader that the repository contains."""
    return sorted((CORPUS / target.slug).glob("*"))


def write_seeds(target: Target, corpus: Path) -> None:
    """Writes the seeds and the stored inputs of a reader to the corpus folder of a search."""
    folder = corpus / target.slug
    folder.mkdir(parents=True, exist_ok=True)
    for data in (*target.seeds, *(path.read_bytes() for path in stored(target))):
        (folder / hashlib.sha1(data).hexdigest()).write_bytes(data)


def choose(target: Target, candidates: list[bytes], room: Path) -> list[bytes]:
    """Returns few inputs that together reach as many lines of the code as possible, by greedy choice."""
    covered = {data: _places(target, data, room) for data in candidates}
    for seed in target.seeds:
        reached = _places(target, seed, room)
        covered = {data: places - reached for data, places in covered.items()}
    chosen: list[bytes] = []
    left = MAX_READER_BYTES
    while covered:
        best = max(covered, key=lambda data: (len(covered[data]) / (len(data) + 50), data))
        gained = covered.pop(best)
        if not gained:
            break
        if len(best) > left:
            continue
        chosen.append(best)
        left -= len(best)
        covered = {data: places - gained for data, places in covered.items()}
    return chosen


def _places(target: Target, data: bytes, room: Path) -> set[tuple[CodeType, int]]:
    """Returns the lines of enliven that run while an input is read."""
    places: set[tuple[CodeType, int]] = set()

    def trace(frame: FrameType, event: str, argument: Any) -> Any:
        if not frame.f_code.co_filename.startswith(CODE):
            return None
        if event == "line":
            places.add((frame.f_code, frame.f_lineno))
        return trace

    sys.settrace(trace)
    try:
        target.read(data, room)
    except Exception as error:
        # A refusal for a different reason is a different outcome.
        del error
    finally:
        sys.settrace(None)
    return places


def _rewrite(target: Target, found: Path, room: Path) -> Iterator[Path]:
    """Replaces the stored inputs of a reader, except those that once broke it."""
    kept = [path for path in stored(target) if path.name.startswith(REGRESSION)]
    paths = [*stored(target), *sorted((found / target.slug).glob("*"))]
    candidates = {path.read_bytes() for path in paths if path.stat().st_size <= MAX_INPUT_BYTES}
    chosen = choose(target, sorted(candidates), room)
    for path in stored(target):
        if path not in kept:
            path.unlink()
    folder = CORPUS / target.slug
    folder.mkdir(parents=True, exist_ok=True)
    for data in chosen:
        path = folder / hashlib.sha1(data).hexdigest()[:12]
        path.write_bytes(data)
        yield path


def main() -> None:
    """Chooses the stored inputs of every reader again."""
    import fuzz_readers

    total = 0
    with fuzz_law.room() as room:
        for target in fuzz_readers.targets():
            paths = list(_rewrite(target, Path("out/fuzz/corpus"), Path(room)))
            size = sum(path.stat().st_size for path in stored(target))
            total += size
            print(f"{target.name}: {len(paths)} inputs, {size} bytes", flush=True)
    print(f"{total} bytes in all")


if __name__ == "__main__":
    main()
