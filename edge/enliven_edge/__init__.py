"""The program beside the depth camera: it tracks people, moves characters with them and publishes both.

:mod:`enliven_edge.service` is the loop; each stage of a frame is a room of its own, and
``docs/architecture.md`` has the map.
"""

from enliven_edge.onnx_runtime import disable_telemetry

# Before a sensor or reader of another package can load the library.
disable_telemetry()
