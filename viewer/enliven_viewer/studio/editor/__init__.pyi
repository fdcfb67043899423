from .editor import Edit, Editor

__all__ = ["Edit", "Editor"]
