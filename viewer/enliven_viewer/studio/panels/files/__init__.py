"""The panels about files: export options, and work in progress."""
