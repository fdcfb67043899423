"""One-shot functions. Each performs a complete task of the library in one call, based on the solver
classes."""
