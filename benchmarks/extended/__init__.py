"""Attitudes in extended precision (80 bits on x86), by code that shares nothing with the library; needs a C compiler.

`Truth(body)` follows the joints along `Terms` (sums of harmonics, bumps, ramps and bursts) or along the polynomials and
Fourier series of a `ShapePath`, and integrates the attitude by extrapolation to errors far below double rounding.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

import shapephase as sp
from shapephase.shape_space.curves import PiecewisePolynomial

_TERM = 7
_IDENTITY = np.array([0.0, 0.0, 0.0, 1.0], dtype=np.longdouble)
CONSTANT, HARMONIC, GAUSSIAN, RAMP, BURST, BUMP, _FOURIER = map(float, range(7))


@dataclass(frozen=True)
class Terms:
    """A sum of terms: rows of kind, coordinate, amplitude, centre [s], width [s], frequency [rad/s], phase."""

    n_shape: int
    rows: np.ndarray

    def __call__(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shapes and rates in double precision: (N,) -> (N, n), (N, n)."""
        shapes, rates = np.zeros((2, len(times), self.n_shape))
        for kind, coordinate, amplitude, centre, width, frequency, phase in self.rows:
            s, i = times - centre, int(coordinate)
            x = s / width if width else s
            if kind == CONSTANT:
                value, slope = np.full_like(s, amplitude), 0.0 * s
            elif kind == HARMONIC:
                value = amplitude * np.sin(frequency * s + phase)
                slope = amplitude * frequency * np.cos(frequency * s + phase)
            elif kind == GAUSSIAN:
                value = amplitude * np.exp(-x * x)
                slope = -2.0 * x / width * value
            elif kind == RAMP:
                value = amplitude * np.tanh(x)
                slope = amplitude * (1.0 - np.tanh(x) ** 2) / width
            elif kind == BURST:
                envelope = amplitude * np.exp(-x * x)
                wave, turn = np.sin(frequency * s + phase), np.cos(frequency * s + phase)
                value, slope = envelope * wave, envelope * (frequency * turn - 2.0 * x / width * wave)
            else:
                inside = np.abs(x) < 1.0
                d = np.where(inside, 1.0 - np.where(inside, x * x, 0.0), 1.0)
                value = np.where(inside, amplitude * np.exp(1.0 - 1.0 / d), 0.0)
                slope = -value * 2.0 * x / (d * d * width)
            shapes[:, i] += value
            rates[:, i] += slope
        return shapes, rates


_NUMBERS = ("turn", "place", "axis", "slide", "mass", "centre", "inertia", "matrix", "offset")


class _Body(ctypes.Structure):
    _fields_ = (
        ("joints", ctypes.c_int),
        ("shapes", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("parent", *_NUMBERS)),
    )


class _Path(ctypes.Structure):
    _fields_ = (
        ("terms", ctypes.c_int), ("order", ctypes.c_int), ("pieces", ctypes.c_int),
        ("term", ctypes.c_void_p), ("knots", ctypes.c_void_p), ("series", ctypes.c_void_p),
        ("origin", ctypes.c_double), ("pace", ctypes.c_double),
    )  # fmt: skip


class TooLong(ArithmeticError):
    """The extended precision would take longer than allowed."""


@dataclass(frozen=True)
class Segment:
    """A part of a motion: a curve followed at the times origin + pace t, t from 0 to `duration`.

    Attributes
    ----------
    breaks : in the segment's own time, the first 0, the last its end [s]; of polynomials their knots
    pace : 1, or -1 for a curve run through backwards (with `origin` at its end), or 1/2 for half as fast
    """

    path: sp.ShapePath | Terms
    breaks: np.ndarray
    duration: float
    origin: float = 0.0
    pace: float = 1.0

    @property
    def terms(self) -> int:
        """How many terms are added up at each time."""
        return len(_parts(self.path, self.path.n_shape)[0])


class Truth:
    """Extended-precision mechanics of one body."""

    def __init__(self, body: sp.Body) -> None:
        chain = body.chain
        self._kept = [np.ascontiguousarray(chain.parents, dtype=np.int32)]
        for part in (
            chain.turns, chain.places, chain.axes, chain.slides, chain.masses, chain.centres, chain.inertias,
            chain.matrix, chain.offset,
        ):  # fmt: skip
            self._kept.append(np.ascontiguousarray(part, dtype=np.float64))
        self._body = _Body(len(chain.names), body.n_shape, *(part.ctypes.data for part in self._kept))
        self._n_shape = body.n_shape

    def attitudes(
        self, path: sp.ShapePath | Terms, breaks: np.ndarray, body_momentum: np.ndarray, times: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Quaternions x y z w (N, 4) in long double, from the identity at the start, and a bound of their error [rad].

        Parameters
        ----------
        body_momentum : (3,) in base axes at the start [kg m^2/s]
        times : (N,) ascending [s]
        """
        edges = np.asarray(breaks, dtype=np.float64)
        return self.along([Segment(path, edges, float(edges[-1]))], body_momentum, times)

    def along(
        self, segments: Sequence[Segment], body_momentum: np.ndarray, times: np.ndarray, most_steps: float = 1e15
    ) -> tuple[np.ndarray, float]:
        """As `attitudes`, along segments one after another; a loop repeated is one segment many times.

        Raises
        ------
        TooLong
            If more than `most_steps` steps are needed.
        """
        starts = np.concatenate([[0.0], _starts(segments)])
        number = np.minimum(np.searchsorted(starts, times, side="right") - 1, len(segments) - 1)
        left, momentum = ctypes.c_long(int(most_steps)), np.ascontiguousarray(body_momentum, dtype=np.float64)
        resting = not momentum.any()
        loops: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        attitude, error, out = _IDENTITY.copy(), 0.0, np.empty((len(times), 4), dtype=np.longdouble)
        for k, segment in enumerate(segments):
            here = np.flatnonzero(number == k)
            local = np.minimum(times[here] - starts[k], segment.breaks[-1])
            if not resting:
                out[here], added = self._integrated(segment, momentum, local, attitude, left)
                error += added
                continue
            # At rest a loop does the same whatever the attitude, and is followed once.
            if id(segment) not in loops:
                same = [j for j, other in enumerate(segments) if other is segment]
                whole = np.minimum(np.concatenate([times[number == j] - starts[j] for j in same]), segment.breaks[-1])
                order, end = np.argsort(whole), _IDENTITY.copy()
                found, added = self._integrated(segment, momentum, whole[order], end, left)
                error += added * len(same)
                kept = np.empty_like(found)
                kept[order] = found
                loops[id(segment)] = kept, end
            kept, end = loops[id(segment)]
            out[here], loops[id(segment)] = _product(attitude, kept[: len(here)]), (kept[len(here) :], end)
            attitude = _product(attitude, end)
        return out, 2.0 * error

    def _integrated(
        self, segment: Segment, momentum: np.ndarray, times: np.ndarray, attitude: np.ndarray, left: ctypes.c_long
    ) -> tuple[np.ndarray, float]:
        """Quaternions at ascending times of a segment, and their error; `attitude` goes to its end, `left` down."""
        terms, knots, series = _parts(segment.path, self._n_shape)
        edges, when = (np.ascontiguousarray(part, dtype=np.float64) for part in (segment.breaks, times))
        described = _Path(
            len(terms), len(series), max(len(knots) - 1, 0), terms.ctypes.data, knots.ctypes.data, series.ctypes.data,
            segment.origin, segment.pace,
        )  # fmt: skip
        out = np.empty((len(when), 4), dtype=np.longdouble)
        error = _library().attitudes(
            ctypes.byref(self._body), ctypes.byref(described), len(edges), _at(edges), _at(momentum), 1e-17,
            len(when), _at(when), _at(out), _at(attitude), ctypes.byref(left),
        )  # fmt: skip
        if error == -2.0:
            raise TooLong("the extended integrator needs too many steps")
        if error < 0.0:
            raise ArithmeticError("the steps of the extended integrator became too short")
        return out, error

    def inertia_and_momentum(self, shapes: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """I (9, row by row) and L_o (3) in long double: (N, n), (N, n) -> (N, 12)."""
        out = np.empty((len(shapes), 12), dtype=np.longdouble)
        q, v = (np.ascontiguousarray(part, dtype=np.float64) for part in (shapes, rates))
        _library().bodies(ctypes.byref(self._body), len(q), _at(q), _at(v), _at(out))
        return out


def angles_between(quaternions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Angles between long double quaternions (N, 4) and rotation matrices in doubles (N, 3, 3): (N,) [rad]."""
    x, y, z, w = quaternions.T
    exact = np.stack(
        [
            1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
        ],
        axis=-1,
    ).reshape(-1, 3, 3)  # fmt: skip
    gap = rotations.astype(np.longdouble) - exact
    return 2.0 * np.arcsin(np.minimum(np.sqrt((gap * gap).sum(axis=(1, 2)) / 8.0), 1.0)).astype(float)


def exact_path(path: sp.ShapePath) -> sp.ShapePath:
    """The same path as the extended precision follows it: its own polynomials or harmonics, or polynomials along it."""
    known = any(hasattr(path.curve, name) for name in ("knots", "sines"))
    return path if known else as_polynomials(path)


def as_polynomials(path: sp.ShapePath, pieces: int = 64, order: int = 16) -> sp.ShapePath:
    """A path of any kind as polynomials on even pieces, which the extended precision follows.

    Of a path that is smooth on [0, duration] they differ from it by its rounding.
    """
    knots = np.linspace(0.0, path.duration, pieces + 1)
    nodes = np.cos(np.pi * (np.arange(order) + 0.5) / order)
    widths = np.diff(knots)
    series = np.empty((order, pieces, path.n_shape))
    for piece, (left, width) in enumerate(zip(knots[:-1], widths, strict=True)):
        shapes = path.shape(left + 0.5 * width * (1.0 + nodes))
        for joint in range(path.n_shape):
            fit = Chebyshev.fit(nodes, shapes[:, joint], order - 1, domain=[-1.0, 1.0])
            series[:, piece, joint] = _about_the_left(fit.coef, width)
    return replace(
        sp.ShapePath.waypoints(knots, path.shape(knots), joint_names=path.joint_names),
        curve=PiecewisePolynomial(knots, series),
    )


def _about_the_left(coefficients: np.ndarray, width: float) -> np.ndarray:
    """Of powers of t in [0, width], from those of Chebyshev polynomials on [-1, 1]."""
    powers = Chebyshev(coefficients, domain=[0.0, width]).convert(kind=Polynomial).coef
    return np.pad(powers, (0, len(coefficients) - len(powers)))


def _parts(path: sp.ShapePath | Terms, n_shape: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    none = np.zeros(0), np.zeros((0, 0, n_shape))
    if isinstance(path, Terms):
        return np.ascontiguousarray(path.rows, dtype=np.float64).reshape(-1, _TERM), *none
    curve = path.curve
    if hasattr(curve, "knots"):
        return np.zeros((0, _TERM)), *(np.ascontiguousarray(part) for part in (curve.knots, curve.coefficients))
    if not hasattr(curve, "cosines"):
        raise TypeError(f"no extended precision for a path made of {type(curve).__name__}")
    rows = [(CONSTANT, i, mean, 0.0, 0.0, 0.0, 0.0) for i, mean in enumerate(curve.mean)]
    for k in range(curve.cosines.shape[1]):
        # Frequency and phase in whole turns, so that none of them is rounded.
        rows += [(_FOURIER, i, a, 0.0, curve.period, k + 1.0, 0.25) for i, a in enumerate(curve.cosines[:, k])]
        rows += [(_FOURIER, i, b, 0.0, curve.period, k + 1.0, 0.0) for i, b in enumerate(curve.sines[:, k])]
    kept = np.array(rows)
    return np.ascontiguousarray(kept[kept[:, 2] != 0.0]), *none


def _starts(segments: Sequence[Segment]) -> np.ndarray:
    """Where each segment ends [s]; loops begin at whole multiples, without the rounding of a sum."""
    if all(segment is segments[0] for segment in segments):
        return segments[0].duration * np.arange(1.0, len(segments) + 1.0)
    return np.cumsum([segment.duration for segment in segments])


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of quaternions x y z w: (4,) and (..., 4)."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, np.moveaxis(b, -1, 0)
    parts = (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
    return np.stack(parts, axis=-1)


def prepare() -> None:
    """Compile the C code now, so that processes made of this one have it."""
    _library()


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    """The C code, compiled into a folder that goes with the process."""
    folder = tempfile.TemporaryDirectory(prefix="shapephase-truth-")
    made = Path(folder.name) / "attitude.so"
    source = Path(__file__).with_name("attitude.c")
    compiler = os.environ.get("CC", "cc").split()
    subprocess.run([*compiler, "-O3", "-shared", "-fPIC", str(source), "-o", str(made), "-lm"], check=True)
    library = ctypes.CDLL(str(made))
    library.folder = folder
    library.attitudes.restype = ctypes.c_double
    pointer = ctypes.c_void_p
    library.attitudes.argtypes = [
        pointer, pointer, ctypes.c_int, pointer, pointer, ctypes.c_double, ctypes.c_int, pointer, pointer, pointer,
        pointer,
    ]  # fmt: skip
    library.bodies.restype = None
    library.bodies.argtypes = [pointer, ctypes.c_int, pointer, pointer, pointer]
    return library
