from ._andoyer_variables import AndoyerVariables, TurningBody, andoyer_from_euler, andoyer_motion, andoyer_variables
from ._arc_quadrature import Arcs
from ._conjugate_locus import (
    ConjugateLocus,
    ConjugatePoints,
    CutLocus,
    conjugate_height_rate,
    conjugate_locus,
    conjugate_points,
    conjugate_points_of_momentum,
    cut_locus,
    cut_time,
)
from ._ellipsoid import (
    EllipsoidStretch,
    astroid,
    ellipsoid,
)
from ._extremal import Extremal, extremal
from ._sadov_variables import SadovVariables, andoyer_from_sadov, sadov_frequencies, sadov_variables
from ._serret_andoyer_constants import (
    GeodesicClass,
    GeodesicConstants,
)
from .axisymmetric_cut import AxisymmetricMetric, axisymmetric_metric
from .distance import ShortestGeodesic, nearest_attitude, shortest_geodesic
from .enclosures import (
    GeodesicEnclosure,
    cut_time_enclosure,
    diameter_enclosure,
    distance_enclosure,
    distance_enclosure_on_su2,
)
from .left_invariant import LeftInvariantMetric, left_invariant_metric
from .metric_profile import Assumptions, TabulatedStretch, assumptions, surface_of_metric
from .serret_andoyer import SerretAndoyerMetric, serret_andoyer_metric
from .serret_andoyer_geodesics import EquatorialConjugatePoints, GeodesicFamily
from .surface_of_revolution import SurfaceOfRevolution, surface_of_stretch

__all__ = [
    "AndoyerVariables",
    "Arcs",
    "Assumptions",
    "AxisymmetricMetric",
    "ConjugateLocus",
    "ConjugatePoints",
    "CutLocus",
    "EllipsoidStretch",
    "EquatorialConjugatePoints",
    "Extremal",
    "GeodesicClass",
    "GeodesicConstants",
    "GeodesicEnclosure",
    "GeodesicFamily",
    "LeftInvariantMetric",
    "SadovVariables",
    "SerretAndoyerMetric",
    "ShortestGeodesic",
    "SurfaceOfRevolution",
    "TabulatedStretch",
    "TurningBody",
    "andoyer_from_euler",
    "andoyer_from_sadov",
    "andoyer_motion",
    "andoyer_variables",
    "assumptions",
    "astroid",
    "axisymmetric_metric",
    "conjugate_height_rate",
    "conjugate_locus",
    "conjugate_points",
    "conjugate_points_of_momentum",
    "cut_locus",
    "cut_time",
    "cut_time_enclosure",
    "diameter_enclosure",
    "distance_enclosure",
    "distance_enclosure_on_su2",
    "ellipsoid",
    "extremal",
    "left_invariant_metric",
    "nearest_attitude",
    "sadov_frequencies",
    "sadov_variables",
    "serret_andoyer_metric",
    "shortest_geodesic",
    "surface_of_metric",
    "surface_of_stretch",
]
