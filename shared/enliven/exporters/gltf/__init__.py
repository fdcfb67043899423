"""The GLB writer: characters of every kind with their motion, one scene."""

from enliven.exporters.gltf.puppet_performance import PuppetPerformance, puppet_performance_of
from enliven.exporters.gltf.write import (
    GraphPerformance,
    Performance,
    graph_performance_of,
    performance_of,
    write_gltf,
)

__all__ = [
    "GraphPerformance",
    "Performance",
    "PuppetPerformance",
    "graph_performance_of",
    "performance_of",
    "puppet_performance_of",
    "write_gltf",
]
