"""The edge's network: TCP servers with bounded queues, the streams to viewers, and their requests."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
