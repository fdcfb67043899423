"""Readers of foreign recordings, found by name or by the files' content.

A reader turns files of one layout into frames of enliven; other packages add readers by the entry-point
group ``enliven.readers``.
"""
