"""What planning returns."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Array
from ..body.body import Body
from ..reconstruction.reconstruction import Motion
from ..shape_space.shape_path import ShapePath


@dataclass(frozen=True)
class Progress:
    """Where a search stands after an iteration of the solver.

    Attributes
    ----------
    stage : "guesses", each improved on a coarse spline, or "search"
    start, starts : which of how many, from 1
    iteration : of the solver, from 0
    cost : so far [of the plan's cost]
    infeasibility : the largest constraint violated so far, scaled: the equations of motion, the goal, the limits
    """

    stage: str
    start: int
    starts: int
    iteration: int
    cost: float
    infeasibility: float


@dataclass(frozen=True)
class Start:
    """How one start of the search went.

    Attributes
    ----------
    status : the solver's word
    converged : whether it is a local optimum that reaches the goal
    cost : at its end [of the plan's cost]
    miss : how far its own attitude at the end is from the goal [rad]
    kkt_residual, infeasibility : conditions of optimality and constraints left over, scaled
    iterations : of the solver
    seconds : it took
    """

    status: str
    converged: bool
    cost: float
    miss: float
    kkt_residual: float
    infeasibility: float
    iterations: int
    seconds: float


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion of the joints that turns a body as asked, and how it was found.

    Attributes
    ----------
    body : who turns
    path : of all its joints; a C2 spline with not-a-knot ends, also where it closes: a file of its samples is read back
        as it was with `read_shape_path(..., periodic=False)`
    motion : its reconstruction, to 1e-10 rad: independent of how the plan was found
    cost_name : "kinetic", "rate", "acceleration" or "time"
    cost : of `path`, by quadrature with the body's own matrices [J s, rad^2/s, rad^2/s^3 or s]
    miss : angle between the reconstructed attitude at the end and the goal [rad]
    transcription_gap : the same before the polish, which is how far the discretisation was wrong [rad]
    polish_steps : Newton corrections of the path's coefficients that took it away
    kkt_residual : of the discrete optimum before the polish, scaled
    coefficients : (pieces + 1, m) control points of the free coordinates [rad or m]
    method : that found it
    iterations : over all starts
    seconds : over all
    starts : one for each start, in their order
    """

    body: Body
    path: ShapePath
    motion: Motion
    cost_name: str
    cost: float
    miss: float
    transcription_gap: float
    polish_steps: int
    kkt_residual: float
    coefficients: Array
    method: str
    iterations: int
    seconds: float
    starts: tuple[Start, ...]
