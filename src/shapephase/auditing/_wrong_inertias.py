"""The hypotheses that a link's mass, centre of mass or inertia is another than the body's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..body.inertial_regressor import PARAMETERS, InertialRegressor, inertial_regressor
from ._observation import Observation
from ._residuals import Residuals, fitted_hypothesis, leftover
from .hypothesis import FittedValue, Hypothesis

_NEXT_TO_NOTHING = 1e-9
"""Of the body's mass: a frame between two joints, whose mass no one can see."""
_STEPS = 6
"""Of Gauss and Newton; each gains about two digits."""
_CANDIDATES = 12
"""Hypotheses that leave the least are fitted to the end, the others to first order."""
_MOST_LOST = 0.9
"""Of a link's mass: to first order a link that is much too heavy would have none."""
_AXES = "xyz"
_ENTRIES = ("xx", "yy", "zz", "yz", "xz", "xy")
_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
_NARROWER = 0.95
"""Largest ratio of a principal moment to the sum of the other two: what is fitted is known to some per cent."""
_FARTHEST = 3.0
"""Radii of gyration of the whole body: no link's centre is farther from where it was."""
_MOST_TIMES = 100.0
"""What a link weighs, of what it weighed."""
_UNSEEN = 1e-9
"""Of a column's entries, relative to those of the body's own momentum: what moves nothing cannot be fitted."""


@dataclass(frozen=True, eq=False)
class _Direction:
    """One way to be wrong: per unit, changes of mass, centre and inertia of one frame."""

    name: str
    label: str
    unit: str
    frame: int
    mass: float
    centre: Array
    inertia: Array
    scale: float


def wrong_inertias(body: Body, fits: Sequence[Residuals]) -> list[Hypothesis]:
    """All of them, each fitted to all runs together."""
    seen = [fit.seen for fit in fits]
    matrices = [inertial_regressor(body.chain, one.trajectory.shapes, one.joint_rates) for one in seen]
    ways = _directions(body)
    # Whitened columns of the ten parameters of every link, and what each hypothesis makes of them.
    of_all = np.vstack([_by_parameters(fit, matrix, body) for fit, matrix in zip(fits, matrices, strict=True)])
    vector = np.concatenate([fit.vector for fit in fits])
    changes = np.array([_as_parameters(way, len(body.chain.masses)) for way in ways])
    columns = of_all @ changes.T
    strength = (columns**2).sum(axis=0)
    seen_at_all = strength > 0.0
    along = vector @ columns
    guesses = np.where(seen_at_all, -along / np.where(seen_at_all, strength, 1.0), 0.0)
    squares = vector @ vector - guesses**2 * strength
    # To first order a link may weigh less than nothing.
    least = np.array([-_MOST_LOST * body.chain.masses[way.frame] / way.mass if way.mass else -np.inf for way in ways])
    too_light = guesses < least
    guesses = np.maximum(guesses, least)
    squares[too_light] = (vector @ vector + 2.0 * guesses * along + guesses**2 * strength)[too_light]
    order = np.argsort(squares, kind="stable")
    found = []
    for rank, place in enumerate(order.tolist()):
        if not seen_at_all[place] or 1.0 / np.sqrt(strength[place]) > 1.0 / _UNSEEN:
            continue
        way, value = ways[place], float(guesses[place])
        left = vector + value * columns[:, place]
        if rank < _CANDIDATES:
            value, left = _to_the_end(body, way, value, columns[:, place], fits, matrices)
        if not _can_be(body, way, value, seen[0].extent):
            continue
        bar = float(1.0 / np.sqrt(strength[place]))
        shown = FittedValue(value=value * way.scale, bar=bar * way.scale, unit=way.unit)
        found.append(
            fitted_hypothesis(way.name, "inertia", leftover(fits, left), parameters=1, values={way.label: shown})
        )
    return found


def _can_be(body: Body, way: _Direction, value: float, extent: float) -> bool:
    """Whether any body can have such a link: principal moments that are positive, of which none exceeds the sum of the
    others, a centre that is within reach, and a mass."""
    mass = body.chain.masses[way.frame]
    if not 0.0 < mass + value * way.mass <= _MOST_TIMES * mass:
        return False
    if float(np.abs(value * way.centre).max()) > _FARTHEST * extent:
        return False
    own = body.chain.inertias[way.frame]
    before, after = np.linalg.eigvalsh(own), np.linalg.eigvalsh(own + value * way.inertia)
    # What the file itself has may be no body's.
    least = min(_NARROWER, (before[0] + before[1]) / max(before[2], np.finfo(float).tiny))
    return bool(after[0] >= -_UNSEEN * after[2] and least * _NARROWER * after[2] <= after[0] + after[1])


def _directions(body: Body) -> list[_Direction]:
    chain, none, zero = body.chain, np.zeros(3), np.zeros((3, 3))
    names: dict[int, str] = {}
    for link, (frame, _) in chain.link_frames.items():
        names.setdefault(frame, link)
    found = []
    for frame, mass in enumerate(chain.masses.tolist()):
        if mass <= _NEXT_TO_NOTHING * body.mass:
            continue
        link = names.get(frame, f"frame {frame}")
        inertia = chain.inertias[frame]
        found.append(_Direction(f"mass of {link}", "mass", "%", frame, mass, none, zero, 100.0))
        found.append(_Direction(f"mass and inertia of {link}", "both", "%", frame, mass, none, inertia, 100.0))
        for axis in range(3):
            label = f"{_AXES[axis]}"
            found.append(
                _Direction(f"centre of {link}, {label}", "centre", "m", frame, 0.0, np.eye(3)[axis], zero, 1.0)
            )
        for entry, (i, j) in zip(_ENTRIES, _PAIRS, strict=True):
            unit = np.zeros((3, 3))
            unit[i, j] = unit[j, i] = 1.0
            found.append(_Direction(f"inertia of {link}, {entry}", "inertia", "kg m^2", frame, 0.0, none, unit, 1.0))
    return found


def _as_parameters(way: _Direction, frames: int) -> Array:
    """To first order, about the centre that the link has: (10 frames,)."""
    whole = np.zeros((frames, PARAMETERS))
    whole[way.frame, 0] = way.mass
    whole[way.frame, 1:4] = way.centre
    whole[way.frame, 4:] = [way.inertia[i, j] for i, j in _PAIRS]
    return whole.ravel()


def _by_parameters(fit: Residuals, regressor: InertialRegressor, body: Body) -> Array:
    """What each parameter of each link adds to the residuals: (M, 10 frames)."""
    seen, matrices = fit.seen, regressor.matrices
    tensor = matrices[:, [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(len(matrices), 3, 3, -1)
    in_base = np.einsum("nijp,nj->nip", tensor, seen.rate) + matrices[:, 6:9]
    # A first moment of mass for a change of centre is the link's mass times the shift.
    weights = np.ones((len(body.chain.masses), PARAMETERS))
    weights[:, 1:4] = body.chain.masses[:, None]
    momentum = seen.attitude @ in_base * weights.ravel()
    centre = seen.attitude @ matrices[:, 9:12] / body.mass * weights.ravel()
    return fit.columns(momentum, centre)


def _to_the_end(
    body: Body,
    way: _Direction,
    value: float,
    column: Array,
    fits: Sequence[Residuals],
    matrices: Sequence[InertialRegressor],
) -> tuple[float, Array]:
    """Gauss and Newton with the whole dependence: the value, and what it leaves."""
    chain = body.chain
    best, least = (value, np.concatenate([fit.vector for fit in fits])), np.inf
    for _ in range(_STEPS):
        masses, centres, inertias = chain.masses.copy(), chain.centres.copy(), chain.inertias.copy()
        masses[way.frame] += value * way.mass
        centres[way.frame] += value * way.centre
        inertias[way.frame] += value * way.inertia
        if masses[way.frame] <= 0.0:
            break
        left = np.concatenate(
            [
                fit.of(_changed(fit.seen, matrix, masses, centres, inertias))
                for fit, matrix in zip(fits, matrices, strict=True)
            ]
        )
        square = float(left @ left)
        if square >= least:
            break
        best, least = (value, left), square
        value -= float(column @ left) / float(column @ column)
    return best


def _changed(
    seen: Observation, regressor: InertialRegressor, masses: Array, centres: Array, inertias: Array
) -> Observation:
    """The same samples of a body with other links."""
    inertia, internal = regressor.inertia_and_momentum(masses[None], centres[None], inertias[None])
    momentum = so3.apply(seen.attitude, so3.apply(inertia[0], seen.rate) + internal[0])
    if seen.centre is None:
        return replace(seen, momentum=momentum)
    shares = np.zeros((len(masses), PARAMETERS))
    shares[:, 0], shares[:, 1:4] = masses, masses[:, None] * (centres - regressor.centres)
    moment = regressor.matrices[:, 9:12] @ shares.ravel()
    return replace(seen, momentum=momentum, centre=seen.centre + so3.apply(seen.attitude, moment / masses.sum()))
