"""Machine code made by Numba, the extra `shapephase[fast]`, for the innermost loops.

The rest of the library asks `engine` alone; the modules in `kernels/` import Numba, and are imported when they are
first needed.
"""
