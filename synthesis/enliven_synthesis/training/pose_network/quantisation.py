"""Quantises the trained network to eight bits, which makes it a third as large and twice as fast on a core.

Two layers stay in full precision. One is the layer of the joint maps, because rounding its logits moves the
mean over a softmax by centimetres. The other is the first convolution. All channels of a crop share one
scale, and heights go up to two metres. So depth would be rounded to one or two centimetres, but a hand is
only a few centimetres in front of the trunk. Weights have seven bits, so that processors that add pairs of
products in sixteen bits (x86 without VNNI) never overflow.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from enliven.arrays import Float32
from enliven_edge.onnx_runtime import load_onnxruntime
from enliven_synthesis.training.dataset import Dataset
from enliven_synthesis.training.pose_network.network import JOINTS

_quantization = load_onnxruntime("onnxruntime.quantization")

_CALIBRATION_SAMPLES = 600
"""Number of training samples for calibrating the value ranges. Some hundreds are enough."""
_RANGE_PERCENTILE = 99.99
"""Percentile of a layer's values that its range covers. If the range covered rare outliers, all other values
would be quantised more coarsely."""
_BATCH_SIZE = 4
"""Samples per run of the network. It limits the memory for intermediate values."""


def quantise(exported: Path, quantised: Path, dataset: Dataset, first: int) -> None:
    """Writes an eight-bit version of the exported network ``exported`` to ``quantised``.

    Args:
        dataset: the data set. Its samples that start at number ``first`` calibrate the value ranges.
    """
    # Import it here. If PyTorch, which belongs to the same extra, is missing, PyTorch is then reported first.
    import onnx

    with (
        tempfile.TemporaryDirectory() as spare,
        contextlib.redirect_stdout(io.StringIO()),
    ):  # Discard the calibrator's output, because it prints its histogram bins.
        folded = Path(spare) / "folded.onnx"
        preparation = load_onnxruntime("onnxruntime.quantization.shape_inference")
        preparation.quant_pre_process(exported, folded, skip_symbolic_shape=True)
        _quantization.quantize_static(
            folded,
            quantised,
            _CalibrationReader(dataset, first),
            quant_format=_quantization.QuantFormat.QDQ,
            per_channel=True,
            reduce_range=True,
            activation_type=_quantization.QuantType.QUInt8,
            weight_type=_quantization.QuantType.QInt8,
            op_types_to_quantize=["Conv", "Add", "Relu"],
            nodes_to_exclude=_find_full_precision_layers(onnx.load(folded)),
            calibrate_method=_quantization.CalibrationMethod.Percentile,
            extra_options={"CalibPercentile": _RANGE_PERCENTILE},
        )


class _CalibrationReader(_quantization.CalibrationDataReader):  # type: ignore[misc]
    """Reads training samples as inputs of the network. Two of three samples include the facing."""

    def __init__(self, dataset: Dataset, first: int) -> None:
        batch = dataset.batch(np.arange(first, min(first + _CALIBRATION_SAMPLES, len(dataset))))
        has_facing = batch.is_person & (np.arange(len(batch.cell)) // _BATCH_SIZE % 3 > 0)
        angle = np.nan_to_num(batch.facing)
        condition = np.stack([has_facing * np.cos(angle), has_facing * np.sin(angle), batch.cell], 1)
        self._image, self._told = batch.image, condition.astype(np.float32)
        self._next = 0

    def get_next(self) -> dict[str, Float32] | None:
        samples = slice(self._next, self._next + _BATCH_SIZE)
        self._next += _BATCH_SIZE
        image = self._image[samples]
        return {"image": image, "told": self._told[samples]} if len(image) else None


def _find_full_precision_layers(model: Any) -> list[str]:
    """Returns the names of the layers that stay in full precision.

    They are the first convolution and the layer of the joint maps.
    """
    shapes = {weights.name: tuple(weights.dims) for weights in model.graph.initializer}
    convolutions = [node for node in model.graph.node if node.op_type == "Conv"]
    return [
        node.name for node in convolutions if "image" in node.input or shapes[node.input[1]][0] == 3 * JOINTS
    ]
