"""Souvenirs of a kiosk: the files of photos and films, and their server for phones."""
