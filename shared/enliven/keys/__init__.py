"""Keys of the network: key files, roles, the encrypted channel of a connection, and pairing with a code."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
