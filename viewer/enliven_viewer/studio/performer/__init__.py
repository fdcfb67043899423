"""The second view, which shows the performer next to the puppet, and thumbnails of key poses."""
