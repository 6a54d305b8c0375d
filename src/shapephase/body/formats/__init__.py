"""Bodies in files that we read: URDF, from its XML."""
