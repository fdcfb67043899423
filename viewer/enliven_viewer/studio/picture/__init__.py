"""The studio's 3-D picture: shapes by the viewer's renderer, skeletons over them."""
