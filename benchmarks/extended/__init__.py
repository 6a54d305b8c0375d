"""Attitudes in extended precision (80 bits on x86), by code that shares nothing with the library; needs a C compiler.

`Truth(body)` follows the joints along `Terms` (sums of harmonics, bumps, ramps and bursts) or along the polynomials and
Fourier series of a `ShapePath`, and integrates the attitude by extrapolation to errors far below double rounding.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

import shapephase as sp

_TERM = 7
CONSTANT, HARMONIC, GAUSSIAN, RAMP, BURST, BUMP = map(float, range(6))


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
    )  # fmt: skip


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
        terms, knots, series = _parts(path, self._n_shape)
        edges = np.ascontiguousarray(breaks, dtype=np.float64)
        described = _Path(
            len(terms), len(series), max(len(knots) - 1, 0), terms.ctypes.data, knots.ctypes.data, series.ctypes.data
        )
        out = np.empty((len(times), 4), dtype=np.longdouble)
        start, when = (np.ascontiguousarray(part, dtype=np.float64) for part in (body_momentum, times))
        error = _library().attitudes(
            ctypes.byref(self._body), ctypes.byref(described), len(edges), _at(edges), _at(start), 1e-17,
            len(when), _at(when), _at(out),
        )  # fmt: skip
        if error < 0.0:
            raise ArithmeticError("the steps of the extended integrator became too short")
        return out, 2.0 * error

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
        frequency = 2.0 * np.pi / curve.period * (k + 1)
        rows += [(HARMONIC, i, a, 0.0, 0.0, frequency, 0.5 * np.pi) for i, a in enumerate(curve.cosines[:, k])]
        rows += [(HARMONIC, i, b, 0.0, 0.0, frequency, 0.0) for i, b in enumerate(curve.sines[:, k])]
    kept = np.array(rows)
    return np.ascontiguousarray(kept[kept[:, 2] != 0.0]), *none


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
        pointer, pointer, ctypes.c_int, pointer, pointer, ctypes.c_double, ctypes.c_int, pointer, pointer
    ]  # fmt: skip
    library.bodies.restype = None
    library.bodies.argtypes = [pointer, ctypes.c_int, pointer, pointer, pointer]
    return library
