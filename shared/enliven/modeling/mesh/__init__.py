"""Surgery on triangle meshes: cuts with caps, unions with seams, remeshing and symmetry."""
