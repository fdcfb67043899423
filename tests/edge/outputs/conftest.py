"""The helpers of these tests, and the made people of the retargeting tests, are found."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "mapping"))
