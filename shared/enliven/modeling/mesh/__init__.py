"""Operations on triangle meshes: cuts with caps, unions with smooth seams, remeshing and symmetry."""
