"""Options of the whole test suite, the order of the tests, and the two Hypothesis profiles."""

import collections
import gc
import os
import random
import sys
import tempfile
import time
from pathlib import Path

# Test processes share the cores. If BLAS ran its own threads, they would wait for each other by spinning, and
# a small dense fit took 13 times as much processor time. NumPy reads this when it is first loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Every test runs with the same machine code, and no test compiles in the background.
os.environ["ENLIVEN_NATIVE_KERNELS"] = "off"

import hypothesis
import pytest
from hypothesis.internal.conjecture import providers

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))
sys.path.insert(0, str(Path(__file__).parent / "helpers"))
from durations import TABLE, recorded_durations, table_of

TESTS = Path(__file__).parent
ALIKE = {
    "database": None,
    "deadline": None,
    "print_blob": True,
    "suppress_health_check": [hypothesis.HealthCheck.too_slow],
}
"""Options of both profiles: nothing is stored between runs, and no test fails by its duration."""
# The same examples every day. `make test-more` selects the profile that searches randomly.
hypothesis.settings.register_profile("steady", derandomize=True, **ALIKE)
hypothesis.settings.register_profile("more", derandomize=False, **ALIKE)
hypothesis.settings.load_profile("steady")
find_constants = providers._get_local_constants
no_constants = providers._local_constants


def get_constants():
    """Returns the constants that examples may be drawn from: none in the steady profile.

    Hypothesis draws numbers and strings from all loaded modules of the project, and even a derandomised law
    would see other examples after other tests. No setting turns this off (hypothesis 6.170).
    """
    steady = hypothesis.settings.get_current_profile_name() == "steady"
    return no_constants if steady else find_constants()


providers._get_local_constants = get_constants


def pytest_configure(config):
    # Edge names are reserved in this folder. Other test processes, and edges on this machine, use other
    # folders.
    own = tempfile.TemporaryDirectory(prefix="enliven-tests-")
    config.add_cleanup(own.cleanup)
    os.environ["XDG_RUNTIME_DIR"] = os.environ["XDG_STATE_HOME"] = own.name
    # Keys of the user that runs the tests would lock the edges of the tests.
    os.environ["XDG_CONFIG_HOME"] = own.name
    # A test that changes the preparation of characters must not get a stored result.
    os.environ["ENLIVEN_CHARACTERS"] = "off"


def pytest_collection_finish(session):
    # Imported and collected objects stay until the end, so garbage collections (3 % of the time) skip them.
    gc.collect()
    gc.freeze()


def pytest_addoption(parser):
    parser.addoption(
        "--record-references",
        action="store_true",
        help="store the poses and the picture of tests/system again, on purpose",
    )
    parser.addoption(
        "--record-durations",
        action="store_true",
        help="store how long each file took, for the order of later runs, on purpose",
    )
    parser.addoption(
        "--shuffle",
        type=int,
        metavar="SEED",
        help="run the files, and the tests of each file, in an order of chance",
    )
    parser.addoption(
        "--until", type=float, metavar="TIME", help="skip what has not begun by then (seconds of the epoch)"
    )
    parser.addoption(
        "--examples",
        type=int,
        default=1,
        metavar="TIMES",
        help="try so many times the examples of each law",
    )


# This runs before pytest's own hook, which selects tests by their marks.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    # The longest files come first, so that test processes end at the same time. Files that are not in the
    # table follow.
    durations = recorded_durations()
    items.sort(key=lambda item: (-durations.get(item.path, 0.0), item.path))
    for item in items:
        if item.path.is_relative_to(TESTS / "real"):
            item.add_marker(pytest.mark.slow)
    seed = config.getoption("--shuffle")
    if seed is not None:
        items[:] = shuffled(items, random.Random(seed))
    times = config.getoption("--examples")
    for item in items if times != 1 else ():
        if hypothesis.is_hypothesis_test(getattr(item, "obj", None)):
            try_more(item.obj, times)


def shuffled(items, dice):
    """Returns the tests in random order. Tests of a file stay together, so that its fixtures are created
    once.
    """
    files = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    order = list(files.values())
    dice.shuffle(order)
    for tests in order:
        dice.shuffle(tests)
    return [test for tests in order for test in tests]


def try_more(law, times):
    """Multiplies the number of examples of a @given test. Hypothesis has no public option for this."""
    own = law._hypothesis_internal_use_settings
    law._hypothesis_internal_use_settings = hypothesis.settings(own, max_examples=times * own.max_examples)


TAKEN = collections.Counter()
"""Seconds that the tests of each file took in this run, by the path relative to the checkout."""


def pytest_runtest_logreport(report):
    TAKEN[report.nodeid.split("::")[0]] += report.duration


def pytest_sessionfinish(session):
    if session.config.getoption("--record-durations") and "PYTEST_XDIST_WORKER" not in os.environ:
        # A run of the fast tests keeps the recorded durations of files with slow tests, and vice versa.
        recorded = {f"{TESTS.name}/{path.relative_to(TESTS)}": s for path, s in recorded_durations().items()}
        TABLE.write_text(table_of(recorded | TAKEN), encoding="utf-8")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    until = item.config.getoption("--until")
    if until is not None and time.time() > until:
        pytest.skip("the time is out")


@pytest.fixture(autouse=True)
def _usual_window():
    """Restores the default theme and language of the window after each test, because they are global to the
    process.
    """
    yield
    if theme := sys.modules.get("enliven_viewer.theme"):
        theme.use_theme("dark", "usual")
    if language := sys.modules.get("enliven_viewer.language"):
        language.set_language("en")


@pytest.fixture(autouse=True, scope="module")
def _contexts_are_closed():
    """Fails in the test file that forgot to close a ZeroMQ context, which would otherwise block a later
    test.
    """
    yield
    if contexts := sys.modules.get("zmq_contexts"):
        forgotten = contexts.close_leaked_contexts()
        assert not forgotten, f"this file left {forgotten} contexts of ZeroMQ open: close them in the test"
