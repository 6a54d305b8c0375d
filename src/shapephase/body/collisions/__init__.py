"""Collision geometry of a body's links, and the distances between them."""
