"""Bodies in files: URDF and MJCF, read from their XML."""
