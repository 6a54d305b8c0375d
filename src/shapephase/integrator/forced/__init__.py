"""Attitudes whose rate depends on more than themselves: a torque from outside, joints that swing freely."""
