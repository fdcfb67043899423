"""The interface of the studio for features: registration, input over the view, and styles of widgets."""
