"""The viewer program: receives, skins and draws characters, plays takes, and contains the studio (the
editor).
"""
