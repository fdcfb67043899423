"""Adds the folders of random projects and puppets to the import path of these tests."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
# Puppets for tests are defined in one file.
sys.path.append(str(Path(__file__).parents[1] / "examples"))
