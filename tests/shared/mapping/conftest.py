"""Adds the helpers next to these tests to the import path."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
