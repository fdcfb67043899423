"""The live window: keys, captions and cards over the stage."""
