"""The scene without people: the sensor's mounting, floor plane, walls, background model and active zone."""
