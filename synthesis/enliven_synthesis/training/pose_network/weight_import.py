"""Restores a trainable network from an exported file, including the eight-bit one that ships with enliven.

In an exported network, batch normalisations are folded into the convolutions. This module inserts them again
so that the network computes the same result on the calibration samples. Each normalisation gets the mean and
variance of its input on these samples, and the scale and shift that cancel them.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from enliven.arrays import Float32
from enliven.errors import InputError
from enliven_synthesis.training.dataset import Dataset
from enliven_synthesis.training.pose_network.network import PoseNetwork

_CALIBRATION_SAMPLES = 768
"""Number of training samples for calibrating the normalisations. Each has hundreds of cells, so the
statistics are accurate."""
_FORMER_LAYER_NAMES = {".branch.": ".way."}
"""Parts of layer names, and the corresponding parts in networks that earlier versions exported."""


def interpolate_networks(
    first_network: PoseNetwork, second_network: PoseNetwork, share: float
) -> PoseNetwork:
    """Returns a network with weights interpolated between two networks.

    The second was fine-tuned from the first.

    An interpolated network keeps what it learnt about rare samples and forgets less about all others
    (Wortsman et al., "Robust fine-tuning of zero-shot models", CVPR 2022, equation 1).

    Args:
        share: weight of the second network in [0, 1].
    """
    interpolated, first, second = (
        copy.deepcopy(second_network),
        first_network.state_dict(),
        second_network.state_dict(),
    )
    for name, value in second.items():
        if value.is_floating_point():
            second[name] = torch.lerp(first[name], value, share)
    interpolated.load_state_dict(second)
    return interpolated


def restore_network(path: Path, dataset: Dataset, first: int) -> PoseNetwork:
    """Returns the network of an exported .onnx file, ready for further training.

    Args:
        dataset: the data set. Its samples that start at number ``first`` calibrate the normalisations.

    Raises:
        InputError: if the file is missing, damaged, or of a network with other layers.
    """
    weights = _read_weights(path)
    network = PoseNetwork().eval()
    biases = {}
    for name, layer in network.named_modules():
        if isinstance(layer, (nn.Conv2d, nn.Linear)):
            layer.weight.data = _check_weights(weights, f"{name}.weight", tuple(layer.weight.shape), path)
            bias = f"{name}.bias" if layer.bias is not None else f"{name}.weight_bias"
            biases[name] = _check_weights(weights, bias, (layer.weight.shape[0],), path)
            if layer.bias is not None:
                layer.bias.data = biases[name]
    hooks = [
        layer.register_forward_pre_hook(_normalising_hook(biases[_convolution_before(name)]))
        for name, layer in network.named_modules()
        if isinstance(layer, nn.BatchNorm2d)
    ]
    batch = dataset.batch(np.arange(first, min(first + _CALIBRATION_SAMPLES, len(dataset))))
    unknown = np.zeros((len(batch.cell), 2), np.float32)
    condition = np.concatenate([unknown, batch.cell[:, None].astype(np.float32)], 1)
    with torch.no_grad():
        network(torch.from_numpy(batch.image), torch.from_numpy(condition))
    for hook in hooks:
        hook.remove()
    return network


def _convolution_before(normalisation: str) -> str:
    """Returns the name of the layer directly before a normalisation in the same sequence."""
    sequence, _, place = normalisation.rpartition(".")
    return f"{sequence}.{int(place) - 1}"


def _normalising_hook(bias: Tensor) -> Callable[[nn.BatchNorm2d, tuple[Tensor]], None]:
    """Returns a hook that sets a normalisation from its first input.

    The normalisation then only adds a bias.
    """

    def hook(layer: nn.BatchNorm2d, inputs: tuple[Tensor]) -> None:
        values = inputs[0].transpose(0, 1).flatten(1)
        mean, variance = values.mean(1), values.var(1)
        layer.running_mean, layer.running_var = mean, variance
        layer.weight.data = (variance + layer.eps).sqrt()
        layer.bias.data = mean + bias

    return hook


def _read_weights(path: Path) -> dict[str, Float32]:
    """Returns the weights of an exported network by name. Eight-bit weights are converted to floats."""
    # Import it here. If PyTorch, which belongs to the same extra, is missing, PyTorch is then reported first.
    import onnx
    from onnx import numpy_helper

    try:
        graph = onnx.load(path).graph
    except Exception as error:  # The errors of onnx.load have no common base class.
        raise _mismatch_error(
            path, f"the file cannot be read as a network ({type(error).__name__})"
        ) from None
    arrays = {initializer.name: numpy_helper.to_array(initializer) for initializer in graph.initializer}
    weights = {name: array for name, array in arrays.items() if array.dtype == np.float32}
    for node in graph.node:
        if node.op_type == "DequantizeLinear" and node.input[0] in arrays:
            packed, scale, zero = (arrays[name].astype(np.float32) for name in node.input)
            along = (-1,) + (1,) * (packed.ndim - 1)
            name = node.input[0].removesuffix("_quantized")
            weights[name] = (packed - zero.reshape(along)) * scale.reshape(along)
    return weights


def _check_weights(weights: dict[str, Float32], name: str, shape: tuple[int, ...], path: Path) -> Tensor:
    """Returns the weights with a name, after checking their shape.

    Raises:
        InputError: if the weights are missing or have another shape.
    """
    former = name
    for now, then in _FORMER_LAYER_NAMES.items():
        former = former.replace(now, then)
    array = weights.get(name, weights.get(former))
    if array is None or array.shape != shape:
        has = "no such layer" if array is None else f"{array.shape}"
        raise _mismatch_error(
            path, f"the network has other layers: expected {name} with the shape {shape}, found {has}"
        )
    return torch.from_numpy(array.copy())


def _mismatch_error(path: Path, problem: str) -> InputError:
    return InputError(problem, where=str(path), remedy="Choose a network that train-estimator has written.")
