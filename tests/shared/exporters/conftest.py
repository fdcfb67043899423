"""Adds the folders with the readers, bodies and puppets for these tests to the import path."""

import sys
from pathlib import Path

SHARED = Path(__file__).parents[1]
sys.path[:0] = [str(Path(__file__).parent)]
sys.path[:0] = [str(SHARED / room) for room in ("formats", "examples", "mapping", "motion_clips")]
