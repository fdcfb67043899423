"""Adds the helpers in this folder, and fixtures of other tests, to the import path."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
TESTS = HERE.parent
sys.path[:0] = [
    str(HERE),
    *(
        str(TESTS / part)
        for part in ("shared/mapping", "shared/exporters", "edge/importing", "edge/synthesis")
    ),
]
