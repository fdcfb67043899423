"""The files that ship with the edge: a recording to try it without a camera, and the trained network."""

from __future__ import annotations

from pathlib import Path

CHAIR = Path(__file__).resolve().parent / "chair.mcap"
"""Nine seconds of a made-up performer before a Kinect v1, with their true joints; made by
``enliven synthesize -o chair.mcap`` and made again by it bit for bit."""
ESTIMATOR = Path(__file__).resolve().parent / "estimator.onnx"
"""The network that estimates the joints; made by ``enliven train-estimator -o estimator.onnx``."""
