"""Errors of a motion's inputs: noise of its joints, errors of its body's inertias, momentum and start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, made_by
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.family import BodyFamily
from ..deformation.rotors import Rotor
from ..display import short_repr
from ..errors import ShapeError, unknown_name
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ._joint_noise import covariance_argument, deviations_argument, sample_covariance
from .recorded_momentum import UNKNOWNS, RecordedMomentum
from .result_derivatives import described_by

_OF_A_LINK = 5  # relative errors: of the mass, of the centre (3), of the inertia
_LEAST_SHARE = 1e-3  # of its own mass and inertia that a link keeps in every draw


@made_by("InertiaErrors(masses=0.05), for example")
@dataclass(frozen=True, kw_only=True)
class InertiaErrors:
    """Relative standard deviations of the inertias of links, independent of each other.

    Each is one number for all moving links, or a mapping from names of links.

    Attributes
    ----------
    masses : of the mass, with which the rotational inertia grows
    centres : of each coordinate of the centre of mass, in radii of gyration of the link
    inertias : of the rotational inertia as a whole, the mass being as it is

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005])
    >>> bars = sp.uncertainty(motion, inertias=sp.InertiaErrors(masses=0.05))
    >>> print(f"{bars.dynamic_phase:.4f} rad")
    0.0107 rad
    """

    masses: float | Mapping[str, float] = 0.0
    centres: float | Mapping[str, float] = 0.0
    inertias: float | Mapping[str, float] = 0.0

    __repr__ = short_repr


class Inputs(NamedTuple):
    """Covariances of inexact inputs: variances (m,) or matrices (m, m); None where an input is exact.

    samples : of the path's samples
    links : of the relative errors of each frame of the body's chain: mass, centre (3), inertia
    momentum, attitude : (3, 3)
    start : (6, 6) of attitude and momentum together
    rotors : of the wheels' values
    fit : source of these, which the other errors move, too
    """

    samples: Array | None
    links: Array | None
    momentum: Array | None
    attitude: Array | None
    start: Array | None
    rotors: Array | None
    fit: RecordedMomentum | None


def inputs_of(
    motion: Motion | ForcedMotion,
    joints: ArrayLike | str | None,
    inertias: InertiaErrors | None,
    momentum: ArrayLike | None,
    attitude: ArrayLike | None,
    start: RecordedMomentum | ArrayLike | None,
    rotors: float | Mapping[str, float] | None,
) -> Inputs:
    """The arguments of `uncertainty`, checked."""
    body, path, _, wheels = described_by(motion)
    if inertias is not None:
        check_object(inertias, "InertiaErrors", "inertias")
    if start is not None and not (momentum is None and attitude is None):
        raise ShapeError("start: it has the errors of momentum and attitude together; leave momentum and attitude out")
    samples = None if joints is None else sample_covariance(body, path, wheels, joints)
    links = None if inertias is None else _link_variances(body, inertias)
    fit, together = None, None
    if isinstance(start, RecordedMomentum):
        fit, together = start, start.covariance if joints is None else start.covariance_by_base
        if isinstance(motion, ForcedMotion) or not (
            np.array_equal(fit.momentum, motion.momentum)
            and np.array_equal(fit.initial_attitude, motion.initial_attitude)
        ):
            raise ShapeError("start: this fit has another momentum or start than the motion; its own is fit.motion")
    elif start is not None:
        together = covariance_argument(finite_array(start, "start"), "start", UNKNOWNS)
    single = _of_vector(momentum, "momentum"), _of_vector(attitude, "attitude")
    of_rotors = None if rotors is None else _rotor_variances(wheels, rotors)
    return Inputs(samples, links, *single, start=together, rotors=of_rotors, fit=fit)


def _of_vector(given: ArrayLike | None, name: str) -> Array | None:
    if given is None:
        return None
    array = finite_array(given, name)
    return deviations_argument(array, name) ** 2 * np.eye(3) if array.ndim == 0 else covariance_argument(array, name, 3)


def _link_variances(body: Body, errors: InertiaErrors) -> Array:
    """Variances of the relative errors of all links: (5 (k + 1),)."""
    deviations = np.zeros((len(body.chain.masses), _OF_A_LINK))
    for name, columns in (("masses", slice(0, 1)), ("centres", slice(1, 4)), ("inertias", slice(4, 5))):
        given = getattr(errors, name)
        if isinstance(given, Mapping):
            for link, deviation in given.items():
                if link not in body.chain.link_frames:
                    raise unknown_name(f"link of {body.name}", link, body.chain.link_frames)
                frame, _ = body.chain.link_frames[link]
                deviations[frame, columns] = deviations_argument(
                    finite_array(deviation, f"{name} of link {link!r}", ()), name
                )
        else:
            deviations[:, columns] = deviations_argument(finite_array(given, name, ()), name)
    return (deviations**2).ravel()


def _rotor_variances(wheels: tuple[Rotor, ...], errors: float | Mapping[str, float]) -> Array:
    """Variances of the values of all wheels: (W,)."""
    names = [wheel.joint for wheel in wheels]
    if not names:
        raise ShapeError("rotors: the motion has no wheels; name them in articulated(..., rotors=, rotor_speeds=)")
    if not isinstance(errors, Mapping):
        return np.full(len(names), deviations_argument(finite_array(errors, "rotors", ()), "rotors") ** 2)
    for joint in errors:
        if joint not in names:
            raise unknown_name("wheel of the motion", joint, names)
    given = [finite_array(errors.get(name, 0.0), f"rotors, {name}", ()) for name in names]
    return deviations_argument(np.array(given), "rotors") ** 2


def by_relative_errors(body: Body, wheels: tuple[Rotor, ...], derivative: Array) -> Array:
    """Derivatives by the five relative errors of each frame, from those by its ten parameters (r, 10 (k + 1))."""
    chain = body.chain
    jacobian = np.zeros((len(chain.masses), 10, _OF_A_LINK))
    entries = chain.inertias[:, [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    jacobian[:, 0, 0], jacobian[:, 4:, 0] = chain.masses, entries
    jacobian[:, 1:4, 1:4] = chain.masses[:, None, None] * _shifts(body, wheels)
    jacobian[:, 4:, 4] = entries
    by_frame = derivative.reshape(*derivative.shape[:-1], len(chain.masses), 10)
    return np.einsum("...kp,kpe->...ke", by_frame, jacobian).reshape(*derivative.shape[:-1], -1)


def _shifts(body: Body, wheels: tuple[Rotor, ...]) -> Array:
    """Shifts of the centre of each frame's mass by unit errors, its radius of gyration: (k + 1, 3, 3) [m].

    Wheels are balanced: their centres stay on their axles.
    """
    chain = body.chain
    masses, traces = chain.masses, np.trace(chain.inertias, axis1=1, axis2=2)
    gyration = np.sqrt(np.divide(0.5 * traces, masses, out=np.zeros_like(masses), where=masses > 0.0))
    shifts = gyration[:, None, None] * np.eye(3)
    for wheel in wheels:
        place = chain.names.index(wheel.joint)
        shifts[place + 1] @= np.outer(chain.axes[place], chain.axes[place])
    return shifts


def drawn_bodies(body: Body, wheels: tuple[Rotor, ...], errors: Array) -> BodyFamily:
    """One body for each row of relative errors (draws, 5 (k + 1))."""
    chain = body.chain
    by_link = errors.reshape(len(errors), -1, _OF_A_LINK)
    growth = np.maximum(1.0 + by_link[..., 0], _LEAST_SHARE)
    tensors = (growth * np.maximum(1.0 + by_link[..., 4], _LEAST_SHARE))[..., None, None] * chain.inertias
    centres = chain.centres + so3.apply(_shifts(body, wheels), by_link[..., 1:4])
    return BodyFamily(body, growth * chain.masses, centres, tensors)
