"""Takes: clips of motion captures, of recordings and of possessed meshes, read from files of any known kind."""
