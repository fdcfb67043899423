"""Adds this folder to the import path, because its tests share helpers."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
