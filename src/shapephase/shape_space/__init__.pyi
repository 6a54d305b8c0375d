from . import files, reach
from .closest_approach import Clearance, ClosestApproach, clearance
from .connection import (
    HorizontalLift,
    connection_slopes,
    curvature,
    holonomy,
    holonomy_derivative,
    horizontal_lift,
    mechanical_connection,
)
from .curvature_field import curvature_on_plane, is_flat, stokes_holonomy
from .path_noise import PathErrors, path_errors
from .shape_path import ShapePath
from .summaries import BodySummary, JointSummary, PartSummary, PathSummary, body_summary, path_summary

__all__ = [
    "BodySummary",
    "Clearance",
    "ClosestApproach",
    "HorizontalLift",
    "JointSummary",
    "PartSummary",
    "PathErrors",
    "PathSummary",
    "ShapePath",
    "body_summary",
    "clearance",
    "connection_slopes",
    "curvature",
    "curvature_on_plane",
    "files",
    "holonomy",
    "holonomy_derivative",
    "horizontal_lift",
    "is_flat",
    "mechanical_connection",
    "path_errors",
    "path_summary",
    "reach",
    "stokes_holonomy",
]
