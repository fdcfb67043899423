from .editor import Edit as Edit, Editor as Editor
