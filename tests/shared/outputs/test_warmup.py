"""Tests that no frame of an output waits for a compiler."""

import subprocess
import sys

import pytest

COUNTED = """
import gc
from numba.core.dispatcher import Dispatcher
from live_scenes import four_characters
from enliven.outputs.output_plan import plan_outputs
from enliven.outputs.settings import collect_output_settings


def kernels():
    return {d: len(d.signatures) for d in gc.get_objects() if isinstance(d, Dispatcher)}

frame = four_characters()
for scheme in ("vmc", "vrchat", "rokoko", "osc"):
    (plan,) = plan_outputs(collect_output_settings([f"{scheme}:127.0.0.1:9"], {}))
    with plan.open() as sender:
        before = kernels()
        packets = sender._output.encode_packets(four_characters())
        new = sorted({d.py_func.__name__ for d, n in kernels().items() if n > before.get(d, 0)})
        print(scheme, len(packets), *new, sep="|")
"""
"""For each output, prints the number of packets and the kernels that its first frame compiled."""


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_first_frame_compiles_no_kernel():
    helpers = [path for path in sys.path if path.endswith("helpers")]
    code = f"import sys; sys.path[:0] = {helpers}\n{COUNTED}"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=280)
    assert shown.returncode == 0, shown.stderr
    lines = [line.split("|") for line in shown.stdout.splitlines()]
    assert [line[0] for line in lines] == ["vmc", "vrchat", "rokoko", "osc"]
    assert all(int(line[1]) >= 1 for line in lines)
    assert [line[2:] for line in lines] == [[]] * 4
