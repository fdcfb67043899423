"""The scene without people: the sensor's mounting, the floor, walls, the background and the active zone."""
