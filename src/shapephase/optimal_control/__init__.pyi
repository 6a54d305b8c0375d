from ._jacobi_fields import ConjugateTime, JacobiFields, conjugate_times, jacobi_fields, shoot
from .extremals import (
    Extremal,
    Hamiltonian,
    WongFit,
    checked_metric,
    extremal,
    hamiltonian,
    initial_state,
    integrated,
    natural_sizes,
    wong_residual,
)
from .plan import Plan, Progress, Start
from .planning import path_cost, plan_reorientation
from .symbolic import SymbolicBody, solved, symbolic_body
from .task import Reorientation, reorientation

__all__ = [
    "ConjugateTime",
    "Extremal",
    "Hamiltonian",
    "JacobiFields",
    "Plan",
    "Progress",
    "Reorientation",
    "Start",
    "SymbolicBody",
    "WongFit",
    "checked_metric",
    "conjugate_times",
    "extremal",
    "hamiltonian",
    "initial_state",
    "integrated",
    "jacobi_fields",
    "natural_sizes",
    "path_cost",
    "plan_reorientation",
    "reorientation",
    "shoot",
    "solved",
    "symbolic_body",
    "wong_residual",
]
