"""Encrypted connections: key files, roles of viewers, the encrypted channel of a connection, and pairing by a
code.
"""
