"""The program beside the depth camera: it tracks people, moves characters with them and publishes both.

:mod:`enliven_edge.service` is the loop; each stage of a frame is a room of its own, and
``docs/architecture.md`` has the map.
"""
