"""enliven for Blender: imports exported motion with the right rest pose, and moves a rig live by VMC."""

bl_info = {
    "name": "enliven",
    "author": "The enliven authors",
    "version": (0, 2, 0),
    "blender": (3, 4, 0),
    "location": "File > Import, and the sidebar of the 3D view",
    "description": "Imports GLB and BVH files of enliven, and moves a rig live",
    "category": "Animation",
}


def register():
    """Adds the operators, the menu entry and the panel."""
    from . import file_import, live

    file_import.register()
    live.register()


def unregister():
    """Removes them, and stops receiving."""
    from . import file_import, live

    live.unregister()
    file_import.unregister()
