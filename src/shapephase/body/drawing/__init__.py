"""Shapes and meshes of a body's file, boxes of equal inertia, and hulls in place of too many shapes."""
