"""The renderer: draws a scene of characters, bodies, props and overlay marks into one image."""
