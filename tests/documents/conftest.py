"""What the documents' tests share is found beside this, and what they make of other tests' material."""

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
