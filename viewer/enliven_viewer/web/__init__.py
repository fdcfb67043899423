"""The web page that shows the live characters: a bridge from an edge to browsers over WebSockets."""
