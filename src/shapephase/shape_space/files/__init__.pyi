from ._segment_poses import SegmentMotion
from .closing import Closing
from .flight import Flight
from .inputs import read_table
from .options import read_names
from .read import RecordedMotion, read_recorded_motion, read_shape_path
from .smoothing import smoothed_path
from .write import write_shape_path

__all__ = [
    "Closing",
    "Flight",
    "RecordedMotion",
    "SegmentMotion",
    "read_names",
    "read_recorded_motion",
    "read_shape_path",
    "read_table",
    "smoothed_path",
    "write_shape_path",
]
