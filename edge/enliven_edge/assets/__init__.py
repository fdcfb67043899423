"""What ships with the edge: a recording to watch before anyone has a camera, and what was learnt."""

from __future__ import annotations

from pathlib import Path

CHAIR = Path(__file__).resolve().parent / "chair.mcap"
"""Nine seconds of a made-up performer before a Kinect v1, with their true joints; made by
``enliven synthesize -o chair.mcap`` and made again by it bit for bit."""

PARTS_FOREST = Path(__file__).resolve().parent / "parts.npz"
"""The forest that names the body part at a depth pixel; made by ``enliven train-parts -o parts.npz``."""
