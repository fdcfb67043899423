"""The renderer: a scene of characters, bodies, props and marks becomes one picture."""
