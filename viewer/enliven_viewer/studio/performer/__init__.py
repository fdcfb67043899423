"""The second view: the performer at the moment that the puppet shows, and thumbnails of key poses."""
