"""Adds the helpers in this folder, and the test folders that contain the seeds, to the import path."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
for folder in (HERE, HERE.parent / "shared" / "formats", HERE.parent / "shared" / "modeling"):
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
