"""The features of the studio, one package each. A feature registers itself with the application."""
