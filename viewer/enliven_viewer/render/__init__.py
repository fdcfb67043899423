"""The renderer: draws a scene of characters, bodies, props and marks into one image."""
