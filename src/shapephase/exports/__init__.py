"""Motions for other programs: tables and data sets, vectors of simulators, attitudes of spacecraft, skeletons.

All raise ShapeError for a batch of motions, TrajectoryError for times outside of the motion or numbers that are not
above 0, and where joints are written WrongObjectError for a body without a path of them. Writers raise UnknownNameError
for another ending and OutputFileError for a file that cannot be written.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
