"""These tests run in the guest that scripts/test_guest.sh boots; anywhere else they are not collected."""

import os
import sys

collect_ignore_glob = [] if os.environ.get("ENLIVEN_GUEST") else ["test_*.py"]


def pytest_runtest_logreport(report):
    """Prints a failure immediately: a guest that is switched off prints nothing later."""
    if report.failed:
        sys.__stdout__.write(f"\n{report.nodeid}\n{report.longreprtext}\n")
        sys.__stdout__.flush()
