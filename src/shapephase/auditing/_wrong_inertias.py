"""The hypotheses that a link's mass, centre of mass or inertia is another than the body's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..body.inertial_regressor import PARAMETERS, InertialRegressor, inertial_regressor
from ..body.link_motions import link_motions
from ._observation import Observation
from ._residuals import Residuals, fitted_hypothesis, leftover
from .hypothesis import FittedValue, Hypothesis

_NEXT_TO_NOTHING = 1e-9  # of the body's mass: a frame between two joints without a visible mass
_STEPS = 6  # of Gauss and Newton; each gains about two digits
_CANDIDATES = 12  # hypotheses that leave least are fitted to the end, the others to first order
_MOST_LOST = 0.9  # of a link's mass: to first order a link that is much too heavy would have none
_AXES = "xyz"
_ENTRIES = ("xx", "yy", "zz", "yz", "xz", "xy")
_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
_NARROWER = 0.95
"""Largest ratio of a principal moment to the sum of the other two: what is fitted is known to some per cent."""
_FARTHEST = 3.0  # radii of gyration of the whole body: no link's centre is farther from where it was
_PERCENT = 100.0
_MOST_TIMES = 100.0  # what a link weighs, of what it weighed
_STILL = 1e-6  # [rad or m] Range of a joint that is at rest
_BY_NOISE = 8.0  # standard deviations of the noise that its range is, too
_OPEN = 1e-6  # share of a number in what the samples leave open
_NAMED = 3  # links in the name of a part
_UNSEEN = 1e-9  # of the body's own momentum: smaller columns move nothing and are not fitted


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


@dataclass(frozen=True)
class _Part:
    """Links that nothing moves against each other.

    frame : the first that has mass
    links : name and frame of each
    """

    frame: int
    links: tuple[tuple[str, int], ...]

    @property
    def name(self) -> str:
        """The first link, and those that are fixed on it, or rest against it."""
        return _joined([link for link, _ in self.links], "fixed" if self.is_one_frame else "fixed or at rest")

    def name_of(self, frame: int) -> str:
        """The links of one frame."""
        return _joined([link for link, own in self.links if own == frame] or [f"frame {frame}"], "fixed")

    @property
    def is_one_frame(self) -> bool:
        """Whether the body's joints allow nothing else."""
        return len({frame for _, frame in self.links}) == 1

    @property
    def remark(self) -> str:
        """All its links, where there are several."""
        return f"one part: {', '.join(link for link, _ in self.links)}" if len(self.links) > 1 else ""


def _joined(links: Sequence[str], how: str) -> str:
    if len(links) == 1:
        return links[0]
    more = f" and {len(links) - _NAMED} more" if len(links) > _NAMED else ""
    return f"{links[0]} with {', '.join(links[1:_NAMED])}{more} ({how})"


def _parts(body: Body, seen: Sequence[Observation]) -> list[_Part]:
    """The part that each frame belongs to."""
    chain = body.chain
    roots = list(range(len(chain.masses)))
    moves = np.zeros(len(chain.parents), dtype=bool)
    for one in seen:
        links = link_motions(chain, one.trajectory.shapes, np.zeros_like(one.trajectory.shapes))
        still = max(_STILL, _BY_NOISE * max(one.noise.joints, default=0.0))
        for joint, parent in enumerate(chain.parents):
            turned = np.swapaxes(links.turns[:, parent], 1, 2)
            pose = [
                turned @ links.turns[:, joint + 1],
                so3.apply(turned, links.places[:, joint + 1] - links.places[:, parent]),
            ]
            moves[joint] |= max(float(np.ptp(each, axis=0).max(initial=0.0)) for each in pose) > still
    for joint, parent in enumerate(chain.parents):
        roots[joint + 1] = joint + 1 if moves[joint] else roots[parent]
    parts = {}
    for root in dict.fromkeys(roots):
        inside = [frame for frame, own in enumerate(roots) if own == root]
        heavy = [frame for frame in inside if chain.masses[frame] > _NEXT_TO_NOTHING * body.mass]
        links = tuple((link, frame) for link, (frame, _) in chain.link_frames.items() if frame in heavy)
        parts[root] = _Part((heavy or inside)[0], links)
    return [parts[root] for root in roots]


def wrong_inertias(body: Body, fits: Sequence[Residuals]) -> list[Hypothesis]:
    """All of them, each fitted to all runs together.

    Links that nothing moves against each other are one part, whose mass, centre and inertia may also all be wrong: so
    they are if one of its links weighs something else.
    """
    seen = [fit.seen for fit in fits]
    parts = _parts(body, seen)
    matrices = [inertial_regressor(body.chain, one.trajectory.shapes, one.joint_rates) for one in seen]
    ways = _directions(body, parts)
    # Whitened columns of the ten parameters of every link, and what each hypothesis makes of them.
    of_all = np.vstack([_by_parameters(fit, matrix, body) for fit, matrix in zip(fits, matrices, strict=True)])
    vector = np.concatenate([fit.vector for fit in fits])
    changes = np.array([_as_parameters(way, len(body.chain.masses)) for way in ways])
    columns = of_all @ changes.T
    strength = (columns**2).sum(axis=0)
    seen_at_all = strength > 0.0
    along = vector @ columns
    guesses = np.where(seen_at_all, -along / np.where(seen_at_all, strength, 1.0), 0.0)
    # To first order a link may weigh less than nothing.
    least = np.array([-_MOST_LOST * body.chain.masses[way.frame] / way.mass if way.mass else -np.inf for way in ways])
    guesses = np.maximum(guesses, least)
    tried = [place for place in range(len(ways)) if seen_at_all[place] and np.sqrt(strength[place]) > _UNSEEN]
    lefts = {place: vector + guesses[place] * columns[:, place] for place in tried}
    found = []
    for rank, place in enumerate(sorted(tried, key=lambda place: leftover(fits, lefts[place]).size)):
        way, value, left = ways[place], float(guesses[place]), lefts[place]
        if rank < _CANDIDATES:
            value, left = _to_the_end(body, way, value, columns[:, place], fits, matrices)
        if not (_is_in_reach(body, way, value, seen[0].extent) and _has_moments(body, way, value)):
            continue
        bar = float(1.0 / np.sqrt(strength[place]))
        shown = FittedValue(value=value * way.scale, bar=bar * way.scale, unit=way.unit)
        found.append(
            fitted_hypothesis(
                way.name,
                "inertia",
                leftover(fits, left),
                parameters=1,
                values={way.label: shown},
                remark=parts[way.frame].remark,
            )
        )
    for part in dict.fromkeys(parts):
        if len(part.links) > 1:
            columns = of_all[:, PARAMETERS * part.frame : PARAMETERS * (part.frame + 1)]
            whole = _whole_part(body, part, columns, fits, matrices)
            found += [] if whole is None else [whole]
    return found


def _is_in_reach(body: Body, way: _Direction, value: float, extent: float) -> bool:
    """True where a link has a mass that is likely at all, and a centre that is within reach."""
    mass = body.chain.masses[way.frame]
    likely = 0.0 < mass + value * way.mass <= _MOST_TIMES * mass
    return bool(likely and np.abs(value * way.centre).max() <= _FARTHEST * extent)


def _has_moments(body: Body, way: _Direction, value: float) -> bool:
    """True where a body can have the principal moments: positive, none larger than the sum of the others."""
    own = body.chain.inertias[way.frame]
    before, after = np.linalg.eigvalsh(own), np.linalg.eigvalsh(own + value * way.inertia)
    # What the file itself has may be no body's.
    least = min(_NARROWER, (before[0] + before[1]) / max(before[2], np.finfo(float).tiny))
    return bool(after[0] >= -_UNSEEN * after[2] and least * _NARROWER * after[2] <= after[0] + after[1])


def _directions(body: Body, parts: Sequence[_Part]) -> list[_Direction]:
    chain, none, zero = body.chain, np.zeros(3), np.zeros((3, 3))
    found = []
    for frame, mass in enumerate(chain.masses.tolist()):
        if mass <= _NEXT_TO_NOTHING * body.mass:
            continue
        link = parts[frame].name_of(frame)
        inertia = chain.inertias[frame]
        found.append(_Direction(f"mass of {link}", "mass", "%", frame, mass, none, zero, _PERCENT))
        found.append(_Direction(f"mass and inertia of {link}", "both", "%", frame, mass, none, inertia, _PERCENT))
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
    best = (0.0, np.concatenate([fit.vector for fit in fits]))
    for _ in range(_STEPS):
        if body.chain.masses[way.frame] + value * way.mass <= 0.0:
            break
        left = _left_by(body, way, value, fits, matrices)
        if left @ left >= best[1] @ best[1]:
            break
        best = (value, left)
        value -= float(column @ left) / float(column @ column)
    return best


def _left_by(
    body: Body, way: _Direction, value: float, fits: Sequence[Residuals], matrices: Sequence[InertialRegressor]
) -> Array:
    """The residuals of a body that is another by so much: (M,)."""
    masses, centres, inertias = body.chain.masses.copy(), body.chain.centres.copy(), body.chain.inertias.copy()
    masses[way.frame] += value * way.mass
    centres[way.frame] += value * way.centre
    inertias[way.frame] += value * way.inertia
    return np.concatenate(
        [
            fit.of(_changed(fit.seen, matrix, masses, centres, inertias))
            for fit, matrix in zip(fits, matrices, strict=True)
        ]
    )


def _whole_part(
    body: Body, part: _Part, columns: Array, fits: Sequence[Residuals], matrices: Sequence[InertialRegressor]
) -> Hypothesis | None:
    """Mass, centre and inertia of a part at once, as far as the samples show them; None where no body has them."""
    chain, frame = body.chain, part.frame
    lengths = np.linalg.norm(columns, axis=0)
    lengths[lengths == 0.0] = 1.0
    left, strengths, right = np.linalg.svd(columns / lengths, full_matrices=False)
    kept = strengths > _UNSEEN * max(float(strengths.max(initial=0.0)), np.finfo(float).tiny)
    inverse = (right[kept].T / strengths[kept]) @ left[:, kept].T / lengths[:, None]
    change = _Direction(part.name, "", "", frame, 0.0, np.zeros(3), np.zeros((3, 3)), 1.0)
    numbers = np.zeros(PARAMETERS)
    rest = _left_by(body, change, 1.0, fits, matrices)
    for _ in range(_STEPS):
        trial = numbers - inverse @ rest
        tried = replace(change, mass=float(trial[0]), centre=trial[1:4], inertia=_tensor(trial[4:]))
        if chain.masses[frame] + tried.mass <= 0.0:
            break
        left_then = _left_by(body, tried, 1.0, fits, matrices)
        if left_then @ left_then >= rest @ rest:
            break
        numbers, change, rest = trial, tried, left_then
    mass = float(chain.masses[frame])
    if not numbers.any() or not _is_in_reach(body, change, 1.0, fits[0].seen.extent):
        return None
    # Where a part has other frames, their share of its inertia is not in this one.
    if part.is_one_frame and not _has_moments(body, change, 1.0):
        return None
    bars = np.linalg.norm(inverse, axis=1)
    # What the samples leave open is not bounded by them.
    open_sides = np.abs(right[~kept]).max(axis=0, initial=0.0) > _OPEN
    bars[open_sides] = np.inf
    values = {"mass": FittedValue(value=_PERCENT * numbers[0] / mass, bar=_PERCENT * bars[0] / mass, unit="%")}
    for axis in range(3):
        values[f"centre {_AXES[axis]}"] = FittedValue(
            value=float(numbers[1 + axis]), bar=float(bars[1 + axis]), unit="m"
        )
    return fitted_hypothesis(
        f"mass, centre and inertia of {part.name}",
        "inertia",
        leftover(fits, rest),
        parameters=int(kept.sum()),
        values=values,
        remark=part.remark,
    )


def _tensor(entries: Array) -> Array:
    """xx yy zz yz xz xy -> (3, 3)."""
    xx, yy, zz, yz, xz, xy = entries.tolist()
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _changed(
    seen: Observation, regressor: InertialRegressor, masses: Array, centres: Array, inertias: Array
) -> Observation:
    """Observation of the samples with other links."""
    inertia, internal = regressor.inertia_and_momentum(masses[None], centres[None], inertias[None])
    momentum = so3.apply(seen.attitude, so3.apply(inertia[0], seen.rate) + internal[0])
    if seen.centre is None:
        return replace(seen, momentum=momentum)
    shares = np.zeros((len(masses), PARAMETERS))
    shares[:, 0], shares[:, 1:4] = masses, masses[:, None] * (centres - regressor.centres)
    moment = regressor.matrices[:, 9:12] @ shares.ravel()
    return replace(seen, momentum=momentum, centre=seen.centre + so3.apply(seen.attitude, moment / masses.sum()))
