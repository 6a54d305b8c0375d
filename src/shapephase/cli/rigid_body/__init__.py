"""`shapephase rigid` and `shapephase conjugate`: a free rigid body, its figures, and its conjugate points."""
