"""The tools of the studio: small state machines driven by pointer and keys, one module each."""
