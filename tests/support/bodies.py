"""The table of bodies, random motions inside their limits, and URDFs of a few links."""

from __future__ import annotations

import numpy as np

import shapephase as sp
from support.long_runs import full_but

BODIES = (*sp.robot_names(), "example:human")
# For a test: few joints and many, slides and wheels, welded links; the other bodies differ from these in numbers only.
EVERY_BODY = full_but(BODIES, "cat_two_halves", "satellite", "astronaut_suited", "example:human")


def random_shapes(body, rng, count):
    """Shapes spread over the middle of the joint limits; a whole turn for a continuous joint: (count, n)."""
    lower, upper = _range(body)
    return rng.uniform(0.9 * lower + 0.1 * upper, 0.1 * lower + 0.9 * upper, (count, body.n_shape))


def random_loop(body, rng, harmonics=2, duration=1.5, amplitude=0.4):
    """A closed Fourier path that stays near the middle of the limits, so a slide is not moved like an angle."""
    lower, upper = _range(body)
    size = np.minimum(amplitude, 0.2 * (upper - lower))[:, None] / np.arange(1, harmonics + 1) ** 2
    cosines, sines = size * rng.uniform(-1.0, 1.0, (2, body.n_shape, harmonics))
    return sp.ShapePath.fourier(0.5 * (lower + upper), cosines, sines, duration, joint_names=body.joint_names)


def _range(body):
    limits = np.where(np.isfinite(body.joint_limits), body.joint_limits, [-np.pi, np.pi])
    return limits[:, 0], limits[:, 1]


def urdf(*elements, name="small"):
    return f'<robot name="{name}">{"".join(elements)}</robot>'


def link(name, mass, inertia, com=(0.0, 0.0, 0.0)):
    """A link; `inertia` (3, 3) or three moments about its centre of mass, in link axes."""
    tensor = np.asarray(inertia, dtype=float)
    tensor = np.diag(tensor) if tensor.ndim == 1 else tensor
    entries = " ".join(
        f'i{"xyz"[i]}{"xyz"[j]}="{float(tensor[i, j])!r}"' for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    )
    return (
        f'<link name="{name}"><inertial><origin xyz="{_three(com)}"/><mass value="{float(mass)!r}"/>'
        f"<inertia {entries}/></inertial></link>"
    )


def joint(name, kind, parent, child, axis=(0.0, 0.0, 1.0), xyz=(0.0, 0.0, 0.0), rpy=(0.0, 0.0, 0.0), extra=""):
    """A joint with wide limits; `extra` is XML put inside, such as <mimic .../>."""
    limit = '<limit lower="-10" upper="10" effort="1" velocity="1"/>' if kind in ("revolute", "prismatic") else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_three(xyz)}" rpy="{_three(rpy)}"/><axis xyz="{_three(axis)}"/>{limit}{extra}</joint>'
    )


def _three(vector):
    return " ".join(repr(float(x)) for x in vector)
