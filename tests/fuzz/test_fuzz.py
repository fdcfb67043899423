"""Tests with 10,000 mutated files and messages: every reader returns a value or reports an error.

    make fuzz-quick                          these tests alone: the same files every time
    make fuzz SECONDS=600                    a search for ten minutes; the seed is printed
    make fuzz SECONDS=600 SEED=7 ONLY=gltf   the same again, of one reader

A file that breaks a reader is kept in the test's folder or in out/fuzz. When the fault is fixed, the file
becomes an input of the corpus: its name then starts with "fault".
"""

import resource
from pathlib import Path

import fuzz_corpus
import fuzz_law
import fuzz_readers
import pytest
from fuzz_mutations import MOST_BYTES

TARGETS = fuzz_readers.targets()
COUNT = 10_000
"""Minimum number of mutations in `make test`."""
MAX_CORPUS_BYTES = 200_000
"""Maximum size of the stored corpus, bytes."""
MOST_MB = 768
"""Maximum memory growth in MB while files of a few kilobytes are read, including kernels and caches."""


@pytest.fixture
def folder():
    with fuzz_law.room() as path:
        yield Path(path)


def test_number_of_mutations_is_as_stated():
    assert sum(target.count for target in TARGETS) >= COUNT
    assert len({target.name for target in TARGETS}) == len(TARGETS)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.slug)
def test_reader_survives_every_mutation(target, folder, tmp_path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in range(target.count):
        fuzz_law.check(target, str(number), folder, tmp_path)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert grown < MOST_MB, f"{target.name} took {grown:.0f} MB"


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.slug)
def test_some_mutated_files_are_still_read(target, folder):
    """Otherwise only the first check of each reader would be tested."""
    for number in range(target.count):
        try:
            target.read(target.make(fuzz_law.dice_of(target, str(number))), folder)
            break
        except target.allowed:
            continue
    else:
        pytest.fail(f"none of {target.count} mutations was read")


def test_corpus_is_small_and_belongs_to_readers():
    slugs = {target.slug for target in TARGETS}
    paths = [path for path in fuzz_corpus.CORPUS.rglob("*") if path.is_file()]
    assert {path.parent.name for path in paths} <= slugs
    assert sum(path.stat().st_size for path in paths) <= MAX_CORPUS_BYTES


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.slug)
def test_reader_survives_the_corpus(target, folder, tmp_path):
    for path in fuzz_corpus.stored(target):
        fuzz_law.check_bytes(target, path.read_bytes(), folder, tmp_path, path.name)


def test_chosen_inputs_reach_different_code(folder):
    """The corpus is chosen by the lines that an input reaches, so inputs with equal outcomes are left out."""
    (target,) = (each for each in TARGETS if each.name == "edge settings")
    target.read(target.seeds[0], folder)  # loads what the first call loads
    refused = b"nodes = =\n"
    chosen = fuzz_corpus.choose(target, [target.seeds[0], refused, refused + b"#"], folder)
    assert chosen == [refused]


def raises(error):
    def read(data, folder):
        raise error

    return read


@pytest.mark.parametrize("error", [KeyError("x"), MemoryError(), RecursionError(), fuzz_law.TooSlow()])
def test_reader_that_breaks_the_rule_is_caught_and_file_kept(folder, tmp_path, error):
    target = fuzz_law.Target("broken", 1, (b"abc",), raises(error))
    with pytest.raises(fuzz_law.Broken, match=f"broken, seed 7: {type(error).__name__}"):
        fuzz_law.check(target, "7", folder, tmp_path)
    (kept,) = tmp_path.iterdir()
    assert kept.read_bytes() == target.make(fuzz_law.dice_of(target, "7"))


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads the present memory from /proc")
def test_reader_that_takes_too_much_memory_is_caught_even_if_it_refuses_the_file(
    folder, tmp_path, monkeypatch
):
    monkeypatch.setattr(fuzz_law, "MAX_GROWTH_MB", 50)

    def read(data, folder):
        # Only memory above the process's earlier peak counts.
        present = int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
        bytes(range(256)) * int((fuzz_law.peak_mb() + 100.0 - present / 2**20) * 2**12)
        raise fuzz_law.EnlivenError("refused")

    with pytest.raises(fuzz_law.Broken, match="TooLarge"):
        fuzz_law.check(fuzz_law.Target("greedy", 1, (b"abc",), read), "7", folder, tmp_path)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.slug)
def test_mutators_accept_what_they_have_mutated(target):
    """The guided search mutates inputs repeatedly. A mutator that raises an error would end its child
    process.
    """
    data, dice = target.seeds[0], fuzz_law.dice_of(target, "mutators")
    for _ in range(100):
        for mutate in target.mutators:
            data = mutate(data[:MOST_BYTES], dice.choice(target.seeds), dice)
            assert isinstance(data, bytes)


def test_endless_reader_is_stopped(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz_law, "PATIENCE", 0.2)

    def read(data, folder):
        while True:
            pass

    target = fuzz_law.Target("endless", 1, (b"abc",), read)
    with pytest.raises(fuzz_law.Broken, match="TooSlow"):
        fuzz_law.check(target, "7", folder, tmp_path)
