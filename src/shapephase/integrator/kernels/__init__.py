"""The innermost loops, in the part of Python that Numba compiles; `machine_code` decides whether it does."""
