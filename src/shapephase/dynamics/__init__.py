"""What drives a motion: the torques of the joints, their power and work. `joint_torques`."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
