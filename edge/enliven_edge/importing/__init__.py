"""Importers of foreign recordings, selected by name or by the files' content.

A reader converts files of one layout to frames of enliven. Other packages can add readers with the
entry-point group ``enliven.readers``.
"""
