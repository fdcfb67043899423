from .isolated import IsolatedOpener as IsolatedOpener
