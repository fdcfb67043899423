"""The helpers of these tests are found beside them, and seeds beside the tests of what they are seeds of."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
for folder in (HERE, HERE.parent / "shared" / "formats", HERE.parent / "shared" / "modeling"):
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
