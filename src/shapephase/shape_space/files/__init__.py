"""Motions of joints as files: CSV, NPZ, OpenSim, ROS, MuJoCo; joints matched by name, smoothing on request.

Faults of a file raise TrajectoryError with the place, unknown names UnknownNameError, wrong options ShapeError, a
library that is not installed MissingExtraError. Docstrings of single functions do not repeat that.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
