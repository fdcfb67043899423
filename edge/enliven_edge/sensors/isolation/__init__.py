"""Process isolation of sensors with libraries that may crash or hang: a helper process, images in shared
memory."""
