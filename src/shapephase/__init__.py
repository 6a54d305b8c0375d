"""shapephase: a free body changes its shape in a known way; how does it turn?"""

from __future__ import annotations

from . import errors
from .body import Body, UnphysicalInertiaWarning
from .catalog import load_body, robot_names
from .connection import curvature, holonomy, holonomy_derivative, mechanical_connection
from .deformation import Deformation, articulated, particles, prescribed, rigid
from .errors import ShapePhaseError
from .gauge import horizontal_gauge, in_gauge, principal_gauge
from .many_paths import FinalAttitudes, final_attitudes
from .motion_files import read_shape_path, write_shape_path
from .phases import PhaseSplit, split
from .reconstruction import Motion, Sensitivity, load_motion, momentum_from_rate, reconstruct
from .return_map import closed_orbits
from .shape_path import ShapePath

__version__ = "0.1.0"

__all__ = [
    "Body",
    "Deformation",
    "FinalAttitudes",
    "Motion",
    "PhaseSplit",
    "Sensitivity",
    "ShapePath",
    "ShapePhaseError",
    "UnphysicalInertiaWarning",
    "articulated",
    "closed_orbits",
    "curvature",
    "errors",
    "final_attitudes",
    "holonomy",
    "holonomy_derivative",
    "horizontal_gauge",
    "in_gauge",
    "load_body",
    "load_motion",
    "mechanical_connection",
    "momentum_from_rate",
    "particles",
    "prescribed",
    "principal_gauge",
    "read_shape_path",
    "reconstruct",
    "rigid",
    "robot_names",
    "split",
    "write_shape_path",
]
