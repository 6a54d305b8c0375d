"""Optimal reorientation: loops of shapes that turn a free body by a given rotation at least cost."""
