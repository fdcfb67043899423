"""The window: hello_imgui runs it; its layout of panels, rendered images, live outputs and desktop."""
