"""Repeats the property-based tests with new random examples until the time is up. The exit code is 1 if a
test fails.

Usage: test_more.py [--minutes N] [pytest arguments ...]
"""

import argparse
import random
import subprocess
import sys
import time

DEFAULT_FOLDERS = ["tests"]
"""Default folders in which property-based tests are searched."""


MAX_EXAMPLE_FACTOR = 64
"""Maximum factor on a test's number of examples. Every round uses twice the examples of the previous round,
up to this factor."""


def run_laws(seed: int, times: int, until: float, rest: list[str]) -> bool:
    """Runs one round of property-based tests in random order until the time is up.

    Returns True if all passed.
    """
    laws = ["-m", "hypothesis", "--hypothesis-profile", "more", "--hypothesis-seed", str(seed)]
    laws += ["--examples", str(times)]
    order = ["--shuffle", str(seed), "--until", str(until)]
    again = [sys.executable, "-m", "pytest", *laws, *(rest or DEFAULT_FOLDERS)]
    print(f"round with seed {seed}. To repeat this round: {' '.join(again)}", flush=True)
    return subprocess.run([*again, *order], check=False).returncode == 0


def main() -> int:
    """Runs rounds with new seeds until the time is over. Returns 1 if tests of a round failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--minutes", type=float, default=10.0, help="minutes after which no further test starts"
    )
    options, rest = parser.parse_known_args()
    rest = [word for word in rest if word != "--"]
    until = time.time() + 60 * options.minutes
    rounds, fell = 0, []
    while time.time() < until:
        seed = random.SystemRandom().randrange(2**32)
        if not run_laws(seed, min(2**rounds, MAX_EXAMPLE_FACTOR), until, rest):
            fell.append(seed)
        rounds += 1
    print(f"{rounds} rounds in {options.minutes:g} min; seeds with failed tests: {fell or 'none'}")
    return 1 if fell else 0


if __name__ == "__main__":
    sys.exit(main())
