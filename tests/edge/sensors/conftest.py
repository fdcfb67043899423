"""Adds the driver in this folder to the import path of these tests."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
