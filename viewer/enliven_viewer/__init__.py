"""The program on the screen: it receives, skins and draws characters, plays takes, and holds the
studio's editor.
"""
