"""What Numba compiles: the only modules that import it, themselves imported when they are first needed."""
