from ._path_cost import path_cost
from .extremals.extremal import Extremal, extremal
from .extremals.hamiltonian import Hamiltonian, hamiltonian
from .extremals.jacobi_fields import ConjugateTime, JacobiFields, conjugate_times, jacobi_fields
from .extremals.shooting import shoot
from .extremals.wong_residual import WongFit, wong_residual
from .plan import Plan, Start
from .plan_options import Goal, Limits, Search, Waypoint
from .planning import plan_reorientation
from .small_loops import SmallLoop, small_loop
from .symbolic import SymbolicBody, symbolic_body
from .way_back import Undo, WayBack, undo

__all__ = [
    "ConjugateTime",
    "Extremal",
    "Goal",
    "Hamiltonian",
    "JacobiFields",
    "Limits",
    "Plan",
    "Search",
    "SmallLoop",
    "Start",
    "SymbolicBody",
    "Undo",
    "WayBack",
    "Waypoint",
    "WongFit",
    "conjugate_times",
    "extremal",
    "hamiltonian",
    "jacobi_fields",
    "path_cost",
    "plan_reorientation",
    "shoot",
    "small_loop",
    "symbolic_body",
    "undo",
    "wong_residual",
]
