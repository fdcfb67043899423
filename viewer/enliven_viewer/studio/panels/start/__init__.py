"""The start page, the text on an empty stage, and the tour's card, outline and hand."""
