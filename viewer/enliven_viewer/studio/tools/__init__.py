"""The tools of the studio: small state machines that pointer and keys drive, one module each."""
