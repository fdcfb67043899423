"""What ships with the edge: a recording to watch before anyone has a camera, and what was learnt."""

from __future__ import annotations

from pathlib import Path

CHAIR = Path(__file__).resolve().parent / "chair.mcap"
"""Nine seconds of a made-up performer before a Kinect v1, with their true joints; made by
``enliven synthesize -o chair.mcap`` and made again by it bit for bit."""

ESTIMATOR = Path(__file__).resolve().parent / "estimator.onnx"
"""The network that says where the joints are; made by ``enliven train-estimator -o estimator.onnx``."""
