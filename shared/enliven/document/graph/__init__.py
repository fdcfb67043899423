"""Possessed meshes in the document: the graph, the streams that its nodes play, and layers on top of them."""
