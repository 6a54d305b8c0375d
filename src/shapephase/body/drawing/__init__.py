"""What is drawn of a body: the shapes and meshes of its file, boxes of equal inertia, hulls of what is too much."""
