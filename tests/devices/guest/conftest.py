"""These tests run in the guest that scripts/test_guest.sh boots; anywhere else they are not collected."""

import os
import sys

collect_ignore_glob = [] if os.environ.get("ENLIVEN_GUEST") else ["test_*.py"]


def pytest_runtest_logreport(report):
    """Says at once why a test failed: a guest that is switched off later says nothing."""
    if report.failed:
        sys.__stdout__.write(f"\n{report.nodeid}\n{report.longreprtext}\n")
        sys.__stdout__.flush()
