"""The program on the screen: it receives, skins and draws characters, plays takes, and edits in
the studio.
"""
