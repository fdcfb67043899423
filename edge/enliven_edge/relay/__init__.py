"""A relay: receives the streams of one edge and forwards them to hundreds of viewers."""
