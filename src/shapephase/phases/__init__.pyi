from .continuation import OrbitBranch, continued_orbits
from .error_estimates import ArcErrors, RunningErrors, SplitErrors
from .forced_split import ForcedSplit
from .momentum_bundle import momentum_connection, momentum_curvature, momentum_generator
from .phase_split import PhaseSplit, SplitMotion
from .phases import (
    ArcPhases,
    RunningPhases,
    arc_phases,
    dynamic_phase_from_energy,
    parallel_transport,
    running_phases,
    split,
)
from .recurrence import Returns, momentum_returns
from .return_map import FixedPoints, ReturnMap, closed_orbits, fixed_points, stroboscopic_map
from .whole_turns import AthleteTurns, TurnCounts, athlete_turns, turn_counts

__all__ = [
    "ArcErrors",
    "ArcPhases",
    "AthleteTurns",
    "FixedPoints",
    "ForcedSplit",
    "OrbitBranch",
    "PhaseSplit",
    "ReturnMap",
    "Returns",
    "RunningErrors",
    "RunningPhases",
    "SplitErrors",
    "SplitMotion",
    "TurnCounts",
    "arc_phases",
    "athlete_turns",
    "closed_orbits",
    "continued_orbits",
    "dynamic_phase_from_energy",
    "fixed_points",
    "momentum_connection",
    "momentum_curvature",
    "momentum_generator",
    "momentum_returns",
    "parallel_transport",
    "running_phases",
    "split",
    "stroboscopic_map",
    "turn_counts",
]
