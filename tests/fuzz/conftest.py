"""Adds the helpers next to these tests to the import path, and the test folders that contain the seeds."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
for folder in (HERE, HERE.parent / "shared" / "formats", HERE.parent / "shared" / "modeling"):
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
