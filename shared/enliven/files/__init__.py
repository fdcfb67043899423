"""Reads and writes files safely: a message says what is wrong, and a failed write leaves the old file.

:func:`read_file` reads a file completely. :func:`write_file` and :func:`replace_file` write an output file
completely or not at all. :func:`replace_folder` does the same for a folder of files. :class:`ReferencedFiles`
opens the files that another file refers to.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
