"""Motions of joints as files: CSV, NPZ, OpenSim, ROS, MuJoCo; joints matched by name, smoothing on request."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
