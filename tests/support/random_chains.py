"""Random trees of links, given to this library as URDF and to MuJoCo as MJCF from the same numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from support.bodies import joint, link, urdf

KINDS = ("revolute", "prismatic", "continuous")


@dataclass(frozen=True, kw_only=True)
class Chain:
    """Links with joints between them.

    Attributes
    ----------
    parents : of each moving link; 0 is the base
    kinds, axes, places, turns : of the joint of each moving link; fixed turns as rotation vectors
    masses, centres, inertias : of all links, the base first, about their centres
    factor : the last joint follows the first by it; None: it follows none
    """

    parents: tuple[int, ...]
    kinds: tuple[str, ...]
    axes: np.ndarray
    places: np.ndarray
    turns: np.ndarray
    masses: np.ndarray
    centres: np.ndarray
    inertias: np.ndarray
    factor: float | None

    @property
    def names(self) -> list[str]:
        """Of the joints."""
        return [f"j{k}" for k in range(len(self.parents))]

    @property
    def urdf(self) -> str:
        """For this library."""
        parts = [
            link(f"l{k}", *row) for k, row in enumerate(zip(self.masses, self.inertias, self.centres, strict=True))
        ]
        for k, parent in enumerate(self.parents):
            mimic = f'<mimic joint="j0" multiplier="{self.factor!r}" offset="0.1"/>' if self.follows(k) else ""
            rpy = Rotation.from_rotvec(self.turns[k]).as_euler("xyz")
            parts.append(
                joint(f"j{k}", self.kinds[k], f"l{parent}", f"l{k + 1}", self.axes[k], self.places[k], rpy, mimic)
            )
        return urdf(*parts)

    @property
    def mjcf(self) -> str:
        """For MuJoCo, every joint on its own."""
        inner = self._body(0)
        return (
            '<mujoco><option gravity="0.3 -0.2 -9.81"/><compiler angle="radian" balanceinertia="false"/>'
            f"<worldbody>{inner}</worldbody></mujoco>"
        )

    def follows(self, k: int) -> bool:
        """Whether a joint follows the first."""
        return self.factor is not None and k == len(self.parents) - 1

    def _body(self, number: int) -> str:
        xx, yy, zz, xy, xz, yz = (self.inertias[number][i] for i in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        inertial = (
            f'<inertial pos="{_words(self.centres[number])}" mass="{float(self.masses[number])!r}" '
            f'fullinertia="{_words((xx, yy, zz, xy, xz, yz))}"/>'
        )
        if number == 0:
            head, moving = '<body name="l0">', "<freejoint/>"
        else:
            k = number - 1
            x, y, z, w = Rotation.from_rotvec(self.turns[k]).as_quat()
            head = f'<body name="l{number}" pos="{_words(self.places[k])}" quat="{_words((w, x, y, z))}">'
            kind = "slide" if self.kinds[k] == "prismatic" else "hinge"
            moving = f'<joint name="j{k}" type="{kind}" axis="{_words(self.axes[k])}"/>'
        children = "".join(self._body(k + 1) for k, parent in enumerate(self.parents) if parent == number)
        return f"{head}{moving}{inertial}{children}</body>"


def random_chain(seed: int) -> Chain:
    """Three to six moving links, among them one that slides and, for even seeds, one that follows."""
    rng = np.random.default_rng([26, seed])
    count = int(rng.integers(3, 7))
    kinds = [str(kind) for kind in rng.choice(KINDS, count)]
    kinds[1] = "prismatic"
    kinds[0] = kinds[-1] = "revolute"
    moments = rng.uniform(0.02, 0.1, (count + 1, 3))
    frames = Rotation.random(count + 1, rng=rng).as_matrix()
    # Moments of positive second moments of mass keep the triangle inequality.
    principal = moments.sum(axis=1, keepdims=True) - moments
    return Chain(
        parents=tuple(int(rng.integers(0, k + 1)) for k in range(count)),
        kinds=tuple(kinds),
        axes=np.array([axis / np.linalg.norm(axis) for axis in rng.normal(size=(count, 3))]),
        places=rng.uniform(-0.4, 0.4, (count, 3)),
        turns=rng.uniform(-1.0, 1.0, (count, 3)),
        masses=rng.uniform(0.5, 3.0, count + 1),
        centres=rng.uniform(-0.2, 0.2, (count + 1, 3)),
        inertias=np.einsum("kij,kj,klj->kil", frames, principal, frames),
        factor=float(rng.uniform(-1.5, 1.5)) if seed % 2 == 0 else None,
    )


def wheel_chain(seed: int) -> Chain:
    """A chain of four links with two moving joints, and a wheel at its end."""
    chain = random_chain(seed)
    rng = np.random.default_rng([7, seed])
    axis = np.array([0.48, 0.6, 0.64])
    inertias, centres = chain.inertias[:4].copy(), chain.centres[:4].copy()
    inertias[3] = 0.03 * np.eye(3) + 0.02 * np.outer(axis, axis)
    centres[3] = 0.1 * axis
    return replace(
        chain,
        parents=(0, 1, 2),
        kinds=("revolute", "prismatic", "continuous"),
        axes=np.array([*chain.axes[:2], axis]),
        places=chain.places[:3],
        turns=rng.uniform(-1.0, 1.0, (3, 3)),
        masses=chain.masses[:4],
        centres=centres,
        inertias=inertias,
        factor=None,
    )


def _words(values) -> str:
    return " ".join(repr(float(value)) for value in values)
