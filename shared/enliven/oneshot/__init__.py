"""One-shot functions: each performs a whole task of the library in one call, based on the solver objects."""
