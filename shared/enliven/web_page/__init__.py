"""The web page that shows characters: its files, and a copy that needs no server."""
