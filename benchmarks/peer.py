"""The compiled C++ peer: peer.cpp, built where a C++ compiler, Eigen's and Pinocchio's headers are found.

Pinocchio's headers, Boost's and the library come with pin's wheel; Eigen's with CasADi's wheel, with
`pip install cmeel-eigen`, or with the system. Flags: -O3 -DNDEBUG, no -march, as Pinocchio's own wheels and as the
packages of a distribution are built. The library is kept in the folder $SHAPEPHASE_PEER, or in one that goes with the
process.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import casadi
import numpy as np
import pinocchio as pin

import shapephase as sp

from .extended import Terms, angles_between

FLAGS = ("-std=c++17", "-O3", "-DNDEBUG", "-shared", "-fPIC", "-w")
# What Pinocchio's own CMake files define for those who link with it.
_DEFINITIONS = (
    "BOOST_MPL_LIMIT_LIST_SIZE=30",
    "BOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "BOOST_FUSION_INVOKE_MAX_ARITY=12",
    "PINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
)
_SYSTEM_EIGEN = Path("/usr/include/eigen3")
_ABSOLUTE = 1e-2
"""The absolute tolerance of the peer as a share of the relative one, as for DOP853."""
_MOST_STEPS = 100_000


class NoPeer(RuntimeError):
    """The peer cannot be built here; the message says what is missing."""


@dataclass(frozen=True)
class PeerSteps:
    """Times [s] and quaternions x y z w of the peer after each of its steps, and its evaluations of the body."""

    times: np.ndarray
    quaternions: np.ndarray
    evaluations: int

    def error(self, exact: np.ndarray) -> float:
        """Largest angle [rad] to `exact`, quaternions in long double at the same times."""
        return float(angles_between(exact, _matrices(self.quaternions)).max())


class _Tree(ctypes.Structure):
    _fields_ = (
        ("joints", ctypes.c_int),
        ("shapes", ctypes.c_int),
        *(
            (name, ctypes.c_void_p)
            for name in ("parent", "turn", "place", "axis", "slide", "mass", "centre", "inertia", "matrix", "offset")
        ),
    )


class _Curve(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("terms", "order", "pieces", "harmonics")),
        *((name, ctypes.c_double) for name in ("frequency", "duration", "largest_bend")),
        *((name, ctypes.c_void_p) for name in ("term", "knots", "series", "mean", "cosines", "sines", "righting")),
    )


class Peer:
    """One body along one path with one momentum, in C++.

    Parameters
    ----------
    path : a Fourier loop, a spline or moves, or `Terms`
    breaks : ascending, the first is the start [s]
    body_momentum : (3,) in base axes at the start [kg m^2/s]
    """

    def __init__(
        self, body: sp.Body, path: sp.ShapePath | Terms, breaks: np.ndarray, body_momentum: np.ndarray
    ) -> None:
        self._library = peer_library()
        self._kept: list[np.ndarray] = []
        chain = body.chain
        parts = (
            chain.turns, chain.places, chain.axes, chain.slides, chain.masses, chain.centres, chain.inertias,
            chain.matrix, chain.offset,
        )  # fmt: skip
        tree = _Tree(
            len(chain.names), body.n_shape, self._at(chain.parents, np.int32), *(self._at(part) for part in parts)
        )
        self._body = self._library.peer_body(ctypes.byref(tree))
        if not self._body:
            raise NoPeer(f"the peer has no screws: {body.name}")
        self._curve = self._followed(path)
        self._breaks, self._edges = len(breaks), self._at(breaks)
        self._momentum = self._at(body_momentum)

    def __del__(self) -> None:
        if getattr(self, "_body", None):
            self._library.peer_forget(self._body)

    def steps(self, relative: float) -> PeerSteps:
        """All steps at a relative tolerance. Raises ArithmeticError where they become too short."""
        times, quaternions = np.empty(_MOST_STEPS), np.empty((_MOST_STEPS, 4))
        evaluations = ctypes.c_long()
        count = self._library.peer_steps(
            *self._motion(relative), _MOST_STEPS, _pointer(times), _pointer(quaternions), ctypes.byref(evaluations)
        )
        if not 0 <= count <= _MOST_STEPS:
            raise ArithmeticError("the steps of the peer became too short")
        return PeerSteps(times[:count].copy(), quaternions[:count].copy(), evaluations.value)

    def seconds(self, relative: float, runs: int = 1) -> float:
        """Processor time of one run, the mean of some, without any call from Python [s]."""
        quaternion = np.empty(4)
        return float(self._library.peer_seconds(*self._motion(relative), runs, _pointer(quaternion))) / runs

    def _motion(self, relative: float) -> tuple[object, ...]:
        return (
            self._body, ctypes.byref(self._curve), self._breaks, self._edges, self._momentum, relative,
            _ABSOLUTE * relative,
        )  # fmt: skip

    def _followed(self, path: sp.ShapePath | Terms) -> _Curve:
        curve = _Curve()
        if isinstance(path, Terms):
            curve.terms, curve.term = len(path.rows), self._at(path.rows)
        elif hasattr(path.curve, "knots"):
            series = path.curve.coefficients
            curve.order, curve.pieces = series.shape[:2]
            curve.knots, curve.series = self._at(path.curve.knots), self._at(np.moveaxis(series, 0, 1))
        elif hasattr(path.curve, "sines"):
            curve.harmonics, curve.frequency = path.curve.sines.shape[1], 2.0 * np.pi / path.curve.period
            curve.mean = self._at(path.curve.mean)
            curve.cosines, curve.sines = self._at(path.curve.cosines.T), self._at(path.curve.sines.T)
        elif hasattr(path.curve, "largest_bend"):
            curve.duration, curve.largest_bend = path.duration, path.curve.largest_bend
            curve.righting = self._at(_righting_weights(path))
        else:
            raise TypeError(f"the peer has no path made of {type(path.curve).__name__}")
        return curve

    def _at(self, array: object, kind: type = np.float64) -> ctypes.c_void_p:
        self._kept.append(np.ascontiguousarray(array, dtype=kind))
        return _pointer(self._kept[-1])


def _righting_weights(path: sp.ShapePath) -> np.ndarray:
    """Of three waist angles, bend, pitch and yaw in the joints of the cat that rights itself: (6, n)."""
    names = list(path.joint_names or ())
    columns = [names.index(name) for name in ("waist_pitch", "waist_yaw", "waist_roll", "front_left_elbow")]
    columns += [names.index(name) for name in ("neck_pitch", "neck_yaw")]
    shapes = path.shape(np.linspace(0.0, path.duration, 101))
    basis = shapes[:, columns] / [1.0, 1.0, 1.0, -2.4, -1.0, -1.0]
    # The factors are decimal numbers of twelve digits at most.
    return np.round(np.linalg.lstsq(basis, shapes, rcond=None)[0], 12)


def _matrices(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices of quaternions x y z w, of any length: (N, 4) -> (N, 3, 3)."""
    return sp.so3.matrix_from_quat(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))


@lru_cache(maxsize=1)
def peer_library() -> ctypes.CDLL:
    """The compiled code. Raises NoPeer where it cannot be built."""
    source = Path(__file__).with_suffix(".cpp")
    compiler = os.environ.get("CXX", "c++").split()
    if shutil.which(compiler[0]) is None:
        raise NoPeer(f"there is no C++ compiler {compiler[0]} (set CXX)")
    prefix = _prefix()
    places = prefix / "include/eigen3", Path(casadi.__file__).parent / "include/eigen3", _SYSTEM_EIGEN
    eigen = next((path for path in places if (path / "Eigen").is_dir()), None)
    if eigen is None:
        raise NoPeer("Eigen's headers are missing: pip install cmeel-eigen")
    command = [
        *compiler, *FLAGS, *(f"-D{name}" for name in _DEFINITIONS), f"-isystem{prefix / 'include'}", f"-isystem{eigen}",
        str(source), f"-L{prefix / 'lib'}", "-lpinocchio_default", f"-Wl,-rpath,{prefix / 'lib'}",
    ]  # fmt: skip
    described = "\0".join([*command, pin.__version__]).encode() + source.read_bytes()
    folder = os.environ.get("SHAPEPHASE_PEER")
    passing = None if folder else tempfile.TemporaryDirectory(prefix="shapephase-peer-")
    place = Path(folder or passing.name)
    made = place / f"peer-{hashlib.sha256(described).hexdigest()[:16]}.so"
    if not made.is_file():
        place.mkdir(parents=True, exist_ok=True)
        draft = made.with_suffix(f".{os.getpid()}")
        run = subprocess.run([*command, "-o", str(draft)], capture_output=True, text=True)
        if run.returncode:
            first = next((line for line in run.stderr.splitlines() if "error" in line), run.stderr[:500])
            raise NoPeer(f"the peer does not compile: {first}")
        draft.replace(made)
    library = ctypes.CDLL(str(made))
    library.folder = passing
    pointer, number, whole = ctypes.c_void_p, ctypes.c_double, ctypes.c_int
    library.peer_body.restype, library.peer_body.argtypes = pointer, [pointer]
    library.peer_forget.restype, library.peer_forget.argtypes = None, [pointer]
    motion = [pointer, pointer, whole, pointer, pointer, number, number]
    library.peer_steps.restype = ctypes.c_long
    library.peer_steps.argtypes = [*motion, ctypes.c_long, pointer, pointer, pointer]
    library.peer_seconds.restype, library.peer_seconds.argtypes = number, [*motion, whole, pointer]
    return library


def _prefix() -> Path:
    """Where pin's wheel keeps headers and libraries."""
    for parent in Path(pin.__file__).parents:
        if (parent / "include/pinocchio").is_dir():
            return parent
    raise NoPeer("Pinocchio's headers are missing: pip install pin")


def _pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
