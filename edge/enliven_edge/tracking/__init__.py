"""The tracker: depth frames in, 20 joints of each person out.

The rooms follow a frame's way: ``frame`` checks and reduces it, ``scene`` knows the room, ``segment`` parts
people from it, ``body_model``, ``fit`` and ``detect`` find each posture, ``people`` keeps who is who,
``output`` smooths and ``health`` says what is wrong. An import never runs back along this way.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
