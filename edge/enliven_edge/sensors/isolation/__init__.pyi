from .isolated import IsolatedOpener

__all__ = ["IsolatedOpener"]
