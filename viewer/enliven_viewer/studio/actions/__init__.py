"""Actions: the commands available to an artist.

Menus, shortcuts, help, command palette and tests are built from them.
"""
