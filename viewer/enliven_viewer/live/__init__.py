"""The live window: keys, the head-up display and match cards over the stage."""
