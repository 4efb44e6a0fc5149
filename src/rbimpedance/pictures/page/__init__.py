"""What the viewer is made of: shapes of an arm, meshes, the scene, its page, and a server on this machine."""
