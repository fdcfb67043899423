"""Triangle meshes: the type, readers of mesh files, repair, and surfaces of scans."""
