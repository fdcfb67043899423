"""The studio's 3D view: shapes drawn by the viewer's renderer, with skeletons over them."""
