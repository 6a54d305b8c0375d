"""Functions of time that deformations are made of, to be scanned once, with the attitude error of each column.

A body turns by R' = R hat(I^-1 (Pi - L_o)). Errors dI, dL_o of the integrand turn the attitude, to first order and at
most, by
    |dI|/I_1 (|Pi|/I_1 + |L_o|/I_1) dt + |dL_o|/I_1 dt
with I_1 the least principal moment. So an entry of I is judged relative to I_1, times one plus the turn that L_o alone
makes in all the time (the sampler multiplies by the turn that Pi makes: it knows Pi, the scan does not), and an entry
of L_o is a rate of turning when divided by I_1. A particle that is off by dx changes I by 2 m r dx and L_o by m r dx':
its lever is m r/I_1, which for a compact body is its share of the mass over its distance. A turn of a frame by one rad
is one rad. In these units columns are what joints are in theirs: a unit of a column turns the body by a rad at most.
A bound that is too large costs a digit of a series, one that is too small hides an error; I_1 is the least moment in
every eighth sample of the scan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Array, Mask
from ..shape_space.scan.function_scan import Judge, ScannedFunction, Words

Pair = Callable[[Array], tuple[Array, Array]]

_ENTRIES = ("xx", "yy", "zz", "yz", "xz", "xy")  # of a symmetric tensor, in these rows and columns
_ROWS, _COLUMNS = np.array([[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]])
_COUNT = len(_ENTRIES)
_AXES = ("x", "y", "z")
_LEAST_MOMENT = 1e-9  # of the largest moment: the integrator refuses a thinner body
_FEW_PARTICLES = 32  # more are scanned by sums over all of them, so that memory stays bounded
_SUMS = 4  # of all positions with random signs: an error of one position shows in every sum
_CHUNK = 4_000_000  # numbers of an array of positions at a time
_STRIDE = 8  # of the samples of the scan from which the size of the body is taken
_RAW_SIZES = 64  # times at which positions are sized before their centre of mass is subtracted
_SLOPES = 32.0  # ratio of slopes to values of U without rates: the degree of the series on a panel


def inertia_and_momentum(sample: Pair, subject: str) -> ScannedFunction:
    """The entries of I (values) and of L_o (rates); I may jump where a break was declared."""

    def curve(times: Array) -> tuple[Array, Array]:
        inertia, momentum = sample(times)
        return inertia[:, _ROWS, _COLUMNS], np.concatenate([momentum, np.zeros_like(momentum)], axis=1)

    def judge(times: Array, columns: Array) -> tuple[Array, Array]:
        drift = np.linalg.norm(columns[:, _COUNT : _COUNT + 3], axis=1)
        least = least_moment(_tensors(columns[::_STRIDE, :_COUNT]))
        turn = float(drift.mean()) * float(times.max()) / least
        weights = np.repeat([(1.0 + turn) / least, 1.0 / least], _COUNT)
        sizes = np.repeat([np.abs(columns[:, :_COUNT]).max(), drift.max(), 0.0], (_COUNT, 3, 3))
        return weights, sizes

    inertias, momenta = [f"inertia I_{entry}" for entry in _ENTRIES], [f"internal momentum L_{axis}" for axis in _AXES]
    return _scanned(
        curve,
        judge,
        subject,
        [f"I_{entry}" for entry in _ENTRIES],
        [*inertias, *momenta, *("nothing",) * 3],
        may_jump=True,
        words=Words(
            units=("kg m^2", "kg m^2/s"),
            continuous="an inertia must be continuous, or have a break declared where it jumps",
        ),
    )


def positions_and_velocities(masses: Array, motion: Pair, raw_size: Callable[[Array], float]) -> ScannedFunction:
    """Particles from their centre of mass, each coordinate a column; of many, sums that hold all of them.

    `motion` gives positions and velocities (N, m, 3) from the centre of mass at times (N,), `raw_size` the largest
    number among the user's positions there [m].
    """
    few = len(masses) <= _FEW_PARTICLES
    signs = np.where(np.random.default_rng(7).random((_SUMS, len(masses))) < 0.5, -masses, masses)

    def curve(times: Array) -> tuple[Array, Array]:
        if few:
            points, speeds = motion(times)
            return points.reshape(len(times), -1), speeds.reshape(len(times), -1)
        chunk = max(1, _CHUNK // (_COUNT * len(masses)))
        parts = [sums(times[start : start + chunk]) for start in range(0, len(times), chunk)]
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])

    def sums(times: Array) -> tuple[Array, Array]:
        """Second moments with their rates, L_o as the rate of nothing, and signed sums of all: 6 + 3 + 3 s columns."""
        points, speeds = motion(times)
        count, weighted = len(times), masses[:, None] * points
        second, flow = (np.swapaxes(weighted, 1, 2) @ part for part in (points, speeds))
        rate, spin = flow + np.swapaxes(flow, 1, 2), flow - np.swapaxes(flow, 1, 2)
        momentum = np.stack([spin[:, 1, 2], spin[:, 2, 0], spin[:, 0, 1]], axis=1)
        places, velocities = ((signs @ part).reshape(count, -1) for part in (points, speeds))
        values = np.concatenate([second[:, _ROWS, _COLUMNS], np.zeros((count, 3)), places], axis=1)
        return values, np.concatenate([rate[:, _ROWS, _COLUMNS], momentum, velocities], axis=1)

    def judge(times: Array, columns: Array) -> tuple[Array, Array]:
        raw = raw_size(times[:: max(1, len(times) // _RAW_SIZES)])
        n = columns.shape[1] // 2
        thinned = columns[::_STRIDE]
        if few:
            points = thinned[:, :n].reshape(len(thinned), -1, 3)
            second = np.einsum("m,nmi,nmj->nij", masses, points, points)
            reach = np.sqrt((points**2).sum(axis=2).max(axis=0))
        else:
            second, reach = _tensors(thinned[:, :_COUNT]), np.zeros(1)
        trace = np.trace(second, axis1=1, axis2=2)
        least = least_moment(trace[:, None, None] * np.eye(3) - second)
        lever = np.maximum(reach, 0.1 * np.sqrt(float(trace.max()) / float(masses.sum()))) / least
        if few:
            return np.tile(np.repeat(masses * lever, 3), 2), np.concatenate([np.full(n, raw), np.zeros(n)])
        kinds = _COUNT, 3, n - _COUNT - 3
        each = np.repeat([1.0 / least, 1.0 / least, float(lever[0])], kinds)
        total = float(masses.sum())
        sizes = np.repeat([total * raw * np.sqrt(float(trace.max()) / total), 0.0, total * raw], kinds)
        return np.tile(each, 2), np.concatenate([sizes, np.zeros(n)])

    names = [f"particle {k} along {axis}" for k in range(len(masses)) for axis in _AXES]
    quantities = [f"{kind} of {name}" for kind in ("position", "velocity") for name in names]
    paired: bool | Mask = True
    if not few:
        names = [f"sum m {a}{b}" for a, b in _ENTRIES] + ["nothing"] * 3
        names += [f"sum {k} of all particles along {axis}" for k in range(_SUMS) for axis in _AXES]
        rates = [f"rate of {name}" for name in names]
        rates[_COUNT : _COUNT + 3] = [f"internal momentum L_{axis}" for axis in _AXES]
        quantities = names + rates
        paired = ~np.isin(np.arange(len(names)) - _COUNT, range(3))
    return _scanned(
        curve,
        judge,
        "the function of the positions",
        names,
        quantities,
        paired=paired,
        words=Words(
            units=("m", "m/s") if few else ("kg m or kg m^2", "kg m/s or kg m^2/s"),
            continuous="particles move continuously",
            rate="velocity" if few else "rate",
            values="positions",
            returned="(positions, velocities)",
        ),
    )


def turns_and_rates(frames: Pair) -> ScannedFunction:
    """The entries of U, and those of its derivative U hat(rate): times (N,) -> U (N, 3, 3), body rates (N, 3)."""

    def curve(times: Array) -> tuple[Array, Array]:
        turned, spin = frames(times)
        slope = np.cross(turned, spin[:, None])
        return turned.reshape(len(times), -1), slope.reshape(len(times), -1)

    def judge(_times: Array, columns: Array) -> tuple[Array, Array]:
        count = columns.shape[1] // 2
        return np.ones(2 * count), np.repeat([1.0, float(np.linalg.norm(columns[:, count:], axis=1).max())], count)

    return _of_turns(curve, judge, paired=True)


def turns_alone(turns: Callable[[Array], Array]) -> ScannedFunction:
    """The entries of U, whose slopes are not given."""

    def curve(times: Array) -> tuple[Array, Array]:
        values = turns(times).reshape(len(times), -1)
        return values, np.zeros_like(values)

    def judge(_times: Array, columns: Array) -> tuple[Array, Array]:
        known = np.repeat([1.0, 0.0], columns.shape[1] // 2)
        return _SLOPES * known, known

    return _of_turns(curve, judge, paired=False)


def _of_turns(curve: Pair, judge: Judge, *, paired: bool) -> ScannedFunction:
    names = [f"entry {row}, {column} of U" for row in range(3) for column in range(3)]
    return _scanned(
        curve,
        judge,
        "the gauge's function U(t)",
        names,
        [*names, *(f"rate of {name}" for name in names)],
        paired=paired,
        words=Words(
            units=("rad", "rad/s"),
            continuous="a frame must turn continuously",
            values="values",
            returned="U and its body rates, hat(rate) = U^T U'",
        ),
    )


def rates_alone(spins: Callable[[Array], Array]) -> ScannedFunction:
    """The body rates of U, which are integrated."""

    def judge(_times: Array, columns: Array) -> tuple[Array, Array]:
        return np.ones(columns.shape[1]), np.repeat([0.0, float(np.linalg.norm(columns[:, 3:], axis=1).max())], 3)

    return _scanned(
        lambda times: (np.zeros((len(times), 3)), spins(times)),
        judge,
        "the function of the body rates of U",
        ["nothing"] * 3,
        ["nothing"] * 3 + [f"rate about {axis}" for axis in _AXES],
        words=Words(units=("rad", "rad/s"), continuous="a frame must turn continuously"),
    )


def momentum_alone(momentum: Callable[[Array], Array], least: Callable[[Array], float], name: str) -> ScannedFunction:
    """The momentum of a wheel (N,) [kg m^2/s], which turns the body at most at its ratio to the least moment."""

    def judge(times: Array, columns: Array) -> tuple[Array, Array]:
        weight = 1.0 / least(times[:: max(1, len(times) // _RAW_SIZES)])
        return np.array([1.0, weight]), np.array([0.0, float(np.abs(columns[:, 1]).max())])

    return _scanned(
        lambda times: (np.zeros((len(times), 1)), momentum(times)[:, None]),
        judge,
        f"the value in time of the wheel {name}",
        ["nothing"],
        ["nothing", f"momentum of the wheel {name}"],
        words=Words(units=("kg m^2/s", "kg m^2/s"), continuous="a wheel's momentum must be continuous"),
    )


def _scanned(
    curve: Pair,
    judge: Judge,
    subject: str,
    columns: Sequence[str],
    quantities: Sequence[str],
    *,
    words: Words,
    paired: bool | Mask = False,
    may_jump: bool = False,
) -> ScannedFunction:
    """Return a function without angles; `paired` and `may_jump` hold for all columns."""
    n = len(columns)
    return ScannedFunction(
        curve=curve,
        judge=judge,
        paired=np.full(n, paired),
        angles=np.zeros(n, dtype=bool),
        may_jump=np.full(n, may_jump),
        subject=subject,
        columns=tuple(columns),
        quantities=tuple(quantities),
        words=words,
    )


def least_moment(inertia: Array) -> float:
    """The least principal moment of all tensors (N, 3, 3), or where they are singular a trifle of the largest."""
    moments = np.linalg.eigvalsh(inertia)
    return float(max(moments[:, 0].min(), _LEAST_MOMENT * moments[:, 2].max(), np.finfo(float).tiny))


def _tensors(entries: Array) -> Array:
    """(N, 6) -> (N, 3, 3)."""
    tensors = np.empty((len(entries), 3, 3))
    tensors[:, _ROWS, _COLUMNS] = tensors[:, _COLUMNS, _ROWS] = entries
    return tensors
