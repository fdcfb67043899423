"""10,000 mutated files and messages: every reader returns a value or says what is wrong, and nothing else.

    make fuzz-quick                          these tests alone: the same files every time
    make fuzz SECONDS=600                    other files for ten minutes; the seed is printed
    make fuzz SECONDS=600 SEED=7 ONLY=gltf   the same again, of one reader

A file that breaks a reader is kept, in the test's folder or in out/fuzz; its seed makes it again. What was
found becomes a test beside those of its reader, with the fault mended.
"""

import resource

import fuzz_law
import fuzz_readers
import pytest

TARGETS = fuzz_readers.targets()
COUNT = 10_000
"""Mutations in `make test`, at least."""
MOST_MB = 768
"""MB that the process may grow by while it reads files of a few kilobytes, kernels and caches included."""


def test_the_count_is_as_stated():
    assert sum(target.count for target in TARGETS) >= COUNT
    assert len({target.name for target in TARGETS}) == len(TARGETS)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name.replace(" ", "-"))
def test_a_reader_bears_every_mutation(target, tmp_path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in range(target.count):
        fuzz_law.check(target, str(number), tmp_path)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert grown < MOST_MB, f"{target.name} took {grown:.0f} MB"


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name.replace(" ", "-"))
def test_the_mutations_reach_behind_the_door(target, tmp_path):
    """Some mutated files are still read: otherwise only the first check of a reader would be tested."""
    read = 0
    for number in range(min(target.count, 60)):
        try:
            target.read(target.make(fuzz_law.dice_of(target, str(number))), tmp_path)
            read += 1
        except target.allowed:
            continue
    assert read > 0
