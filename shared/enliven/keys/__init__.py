"""Keys for encrypted connections: key files, roles, the encrypted channel of a connection, and pairing with a
code.
"""
