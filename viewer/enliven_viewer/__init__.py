"""The program on the screen: receives, skins and draws characters, plays takes, and contains the studio."""
