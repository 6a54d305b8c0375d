"""Joints that follow others: functions of a coordinate, couplings of them, and the map from a shape to all joints."""
