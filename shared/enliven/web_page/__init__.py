"""The web page that shows characters: its files, and a standalone version that needs no server."""
