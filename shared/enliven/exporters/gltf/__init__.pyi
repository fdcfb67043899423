from .puppet_performance import PuppetPerformance, puppet_performance_of
from .write import GraphPerformance, Performance, graph_performance_of, performance_of, write_gltf

__all__ = [
    "GraphPerformance",
    "Performance",
    "PuppetPerformance",
    "graph_performance_of",
    "performance_of",
    "puppet_performance_of",
    "write_gltf",
]
