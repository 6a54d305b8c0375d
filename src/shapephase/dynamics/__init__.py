"""Efforts behind a motion: torques of joints (`joint_torques`), hinges that swing freely (`free_hinges`), wheels."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
