"""Adds this folder to the import path of its tests, for ``source_tree`` and ``words``."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
