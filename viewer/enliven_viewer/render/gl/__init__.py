"""OpenGL 3.3 core: contexts, shader programs and framebuffers."""
