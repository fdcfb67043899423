"""Tests that the code of docs/surgery.md runs unchanged and prints the page's output."""

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).parents[3] / "docs" / "surgery.md"


@pytest.mark.slow
def test_code_of_the_page_runs(capsys):
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) >= 5
    names = {}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
    output = capsys.readouterr().out
    for comment in ("{'elbow': 'elbow 2', 'hand': 'hand 2'}", "('Insert a node', 'Turn')"):
        assert comment in output
    # The elbow is half a metre away at 45 degrees, and the hand is half a metre above it.
    half = np.sqrt(0.5) / 2
    assert f"{half:.3f}" in output
    assert f"{half + 0.5:.3f}" in output
