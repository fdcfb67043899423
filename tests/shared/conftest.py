"""What tests of several parts of the library share is found beside this."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
