"""10,000 mutated files and messages: every reader returns a value or says what is wrong, and nothing else.

    make fuzz-quick                          these tests alone: the same files every time
    make fuzz SECONDS=600                    other files for ten minutes; the seed is printed
    make fuzz SECONDS=600 SEED=7 ONLY=gltf   the same again, of one reader

A file that breaks a reader is kept, in the test's folder or in out/fuzz; its seed makes it again. What was
found becomes a test beside those of its reader, with the fault mended.
"""

import resource
from pathlib import Path

import fuzz_law
import fuzz_readers
import fuzz_seeds
import pytest

TARGETS = fuzz_readers.targets()
COUNT = 10_000
"""Mutations in `make test`, at least."""
MOST_MB = 768
"""MB that the process may grow by while it reads files of a few kilobytes, kernels and caches included."""


@pytest.fixture
def folder():
    with fuzz_law.room() as path:
        yield Path(path)


def test_the_count_is_as_stated():
    assert sum(target.count for target in TARGETS) >= COUNT
    assert len({target.name for target in TARGETS}) == len(TARGETS)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name.replace(" ", "-"))
def test_a_reader_bears_every_mutation(target, folder, tmp_path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in range(target.count):
        fuzz_law.check(target, str(number), folder, tmp_path)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert grown < MOST_MB, f"{target.name} took {grown:.0f} MB"


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name.replace(" ", "-"))
def test_the_mutations_reach_behind_the_door(target, folder):
    """Some mutated files are still read: otherwise only the first check of a reader would be tested."""
    for number in range(target.count):
        try:
            target.read(target.make(fuzz_law.dice_of(target, str(number))), folder)
            break
        except target.allowed:
            continue
    else:
        pytest.fail(f"none of {target.count} mutations was read")


def raises(error):
    def read(data, folder):
        raise error

    return read


@pytest.mark.parametrize("error", [KeyError("x"), MemoryError(), RecursionError(), fuzz_law.TooSlow()])
def test_a_reader_that_breaks_the_law_is_caught_and_its_file_kept(folder, tmp_path, error):
    target = fuzz_law.Target("broken", 1, fuzz_seeds.of_bytes(b"abc"), raises(error))
    with pytest.raises(fuzz_law.Broken, match=f"broken, seed 7: {type(error).__name__}"):
        fuzz_law.check(target, "7", folder, tmp_path)
    (kept,) = tmp_path.iterdir()
    assert kept.read_bytes() == target.make(fuzz_law.dice_of(target, "7"))


def test_a_reader_that_does_not_end_is_stopped(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz_law, "PATIENCE", 0.2)

    def read(data, folder):
        while True:
            pass

    target = fuzz_law.Target("endless", 1, fuzz_seeds.of_bytes(b"abc"), read)
    with pytest.raises(fuzz_law.Broken, match="TooSlow"):
        fuzz_law.check(target, "7", folder, tmp_path)
