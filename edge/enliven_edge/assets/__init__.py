"""The files that ship with the edge: a recording to try it without a camera, and the trained network."""

from __future__ import annotations

from pathlib import Path

CHAIR = Path(__file__).resolve().parent / "chair.mcap"
"""Recording of nine seconds: a synthetic performer in front of a Kinect v1, with the true joints. ``enliven
synthesize -o chair.mcap`` reproduces it bit for bit."""
ESTIMATOR = Path(__file__).resolve().parent / "estimator.onnx"
"""The network that estimates the joints. ``enliven train-estimator -o estimator.onnx`` creates it."""
