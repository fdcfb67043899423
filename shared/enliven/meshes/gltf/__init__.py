"""Low-level glTF 2.0, without rigs: a reader of surfaces and nodes, and a writer of meshes."""
