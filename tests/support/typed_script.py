"""A script as users write it, for mypy: the names that the library loads late have their types all the same."""

from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import shapephase as sp
from shapephase.rigid_body import HalfTwist, half_twist

body = sp.load_body("cat")
path = sp.read_shape_path("robots/cat_righting.csv", body)
motion = sp.reconstruct(sp.articulated(body, path), momentum=[0.05, 0.0, 0.1])
split = sp.split(motion)

assert_type(body, sp.Body)
assert_type(path, sp.ShapePath)
assert_type(motion, sp.Motion)
assert_type(split, sp.PhaseSplit)
assert_type(split.holonomy, NDArray[np.float64])
assert_type(sp.plan_reorientation(body, np.eye(3)), sp.optimal_control.Plan)
assert_type(half_twist([1.0, 2.0, 3.0], [0.0, 1.0, 1e-3]), HalfTwist)
assert_type(sp.geodesics.serret_andoyer_metric([3.0, 2.0, 1.0]), sp.geodesics.SerretAndoyerMetric)
