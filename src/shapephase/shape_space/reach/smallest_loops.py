"""The smallest loops of the joints that turn a free body about one axis.

In the frame that straight rays from the shape carry along, the connection of a small displacement c is

    a_j(c) = F_ij c_i / 2 + D_k F_ij c_k c_i / 3 + ...,

and a loop turns the body by the exponential of minus its integral, up to brackets of fourth order.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import positive_argument
from ...arrays import Array, Integers
from ...display import frozen
from ..shape_path import ShapePath

_STARTS = 24  # random directions of the climbs to the best figure of eight: each ends at a local optimum
_CLIMBS = 200  # largest number of steps of a climb
_SEED = 3  # any fixed seed: repeatable results
_SMALL_PLANE = 1e-12  # rounding of a plane of a loop, relative to the largest
_FIRST_CORRECTION = 5  # of the first correcting circle: no sum of three frequencies among 1, 2 and this vanishes


@frozen
class AxisLoop:
    """The smallest loop that turns a body about one axis, to the leading order of its stroke.

    Attributes
    ----------
    axis : (3,) unit vector, base axes
    order : of the stroke, 2 or 3
    turn : about the axis [rad per stroke^order]
    centre : (n,) shape about which the loop goes [rad or m]
    strokes : (n,) what counts as a stroke of 1 [rad or m]
    planes : (p, 2, n) pairs of directions, in strokes; the first plane is that of the eight at order 3
    frequencies : (p, 2) of the two directions, the first by cosine and the second by sine
    powers : (p,) of the stroke that the size of each plane's part goes with

    Examples
    --------
    >>> found = sp.reachable(sp.load_body("cat_two_halves")).loops[0]
    >>> turned = sp.so3.log(sp.holonomy(sp.load_body("cat_two_halves"), found.loop(0.01)))
    >>> print(f"{turned @ found.axis / (found.turn * 0.01**found.order):.3f}")
    1.000
    """

    axis: Array
    order: int
    turn: float
    centre: Array
    strokes: Array
    planes: Array
    frequencies: Integers
    powers: Array

    def loop(self, stroke: float, duration: float = 1.0) -> ShapePath:
        """The loop with a stroke [1] in some time [s]; raises TrajectoryError for a size that is not above 0."""
        size = positive_argument(stroke, "stroke", "a size without unit")
        length = positive_argument(duration)
        count = int(self.frequencies.max(initial=1))
        cosines, sines = np.zeros((2, len(self.centre), count))
        for plane, (first, second), power in zip(self.planes, self.frequencies, self.powers, strict=True):
            cosines[:, first - 1] += size**power * plane[0] * self.strokes
            sines[:, second - 1] += size**power * plane[1] * self.strokes
        return ShapePath.fourier(self.centre, cosines, sines, length)

    def rotation_vector(self, stroke: ArrayLike) -> Array:
        """Rotation vector of the body by the loop, to leading order: (...) -> (..., 3), base axes [rad]."""
        return self.turn * np.asarray(stroke, dtype=np.float64)[..., None] ** self.order * self.axis


def loops_of_second_order(
    here: Array, centre: Array, strokes: Array, axes: Array, noise: float
) -> tuple[AxisLoop, ...]:
    """Circles in the planes of joints whose curvature is along each axis that it reaches.

    The bivectors B of unit norm with the largest turn F(B) = F_ij B_ij / 2 are the singular vectors of F; of two and
    more planes each is gone round with a frequency of its own. The least energy of all loops with that bivector has
    the largest plane at the lowest frequency.
    """
    first, second = np.triu_indices(len(centre), 1)
    left, values, right = np.linalg.svd(here[first, second].T, full_matrices=False)
    loops = []
    for k in range(min(len(values), len(axes))):
        if values[k] <= noise:
            break
        planes, frequencies = _circles(_matrix(right[k], len(centre)), 1, 1)
        loops.append(
            AxisLoop(
                axis=-left[:, k] + 0.0,
                order=2,
                turn=float(np.pi * values[k]),
                centre=centre,
                strokes=strokes,
                planes=planes,
                frequencies=frequencies,
                powers=np.ones(len(planes)),
            )
        )
    return tuple(loops)


def loops_of_third_order(
    here: Array, slopes: Array, centre: Array, strokes: Array, known: Array, new: Array
) -> tuple[AxisLoop, ...]:
    """Figures of eight, c = v cos t + w sin(2 t)/2, that turn the body about axes which the curvature does not reach.

    They enclose no area and turn it by minus pi/4 D_v F(v, w). Unit v and w with the largest turn about the axis
    are found by climbing. Their turns about axes of second order are cancelled by small circles there.
    """
    first, second = np.triu_indices(len(centre), 1)
    span = here[first, second].T
    loops = []
    for axis in new:
        v, w = _best_eight(slopes @ axis)
        turned = -np.pi / 4 * np.einsum("k,i,j,kija->a", v, v, w, slopes)
        size = float(turned @ axis)
        planes, frequencies, powers = np.array([[v, 0.5 * w]]), np.array([[1, 2]]), np.ones(1)
        if len(known):
            # Circles turn the body by minus pi F(B): what the eight does besides is to vanish.
            cancelling = np.linalg.pinv(np.pi * known @ span) @ (known @ turned)
            circles, theirs = _circles(_matrix(cancelling, len(centre)), _FIRST_CORRECTION, 2)
            planes = np.concatenate([planes, circles])
            frequencies = np.concatenate([frequencies, theirs])
            powers = np.concatenate([powers, np.full(len(circles), 1.5)])
        loops.append(
            AxisLoop(
                axis=np.copysign(1.0, size) * axis + 0.0,
                order=3,
                turn=abs(size),
                centre=centre,
                strokes=strokes,
                planes=planes,
                frequencies=frequencies,
                powers=powers,
            )
        )
    return tuple(loops)


def _matrix(upper: Array, n_shape: int) -> Array:
    """The antisymmetric matrix of a bivector's entries for i < j."""
    matrix = np.zeros((n_shape, n_shape))
    matrix[np.triu_indices(n_shape, 1)] = upper
    return matrix - matrix.T


def _circles(bivector: Array, lowest: int, step: int) -> tuple[Array, Integers]:
    """Circles whose areas over pi add up to a bivector: (p, 2, n) half axes, (p, 2) frequencies from `lowest` on."""
    # B = sum of size (u w^T - w u^T): i B has the eigenvectors (u - i w)/sqrt(2), and their conjugates.
    sizes, vectors = np.linalg.eigh(1j * bivector)
    kept = np.flatnonzero(sizes > _SMALL_PLANE * sizes.max(initial=0.0))[::-1]
    frequencies = lowest + step * np.arange(len(kept))
    axes = np.sqrt(2.0) * np.stack([np.real(vectors), -np.imag(vectors)])[:, :, kept]
    planes = np.sqrt(sizes[kept] / frequencies)[:, None, None] * np.moveaxis(axes, 2, 0)
    return planes, np.stack([frequencies, frequencies], axis=1)


def _best_eight(tensor: Array) -> tuple[Array, Array]:
    """Unit v and w with the largest T_kij v_k v_i w_j, by climbing from many directions: (n, n, n) -> (n,), (n,)."""
    size = len(tensor)
    starts = np.concatenate([np.eye(size), np.random.default_rng(_SEED).normal(size=(_STARTS, size))])
    both = tensor + np.swapaxes(tensor, 0, 1)
    best, directions = -1.0, (starts[0], starts[0])
    for start in starts:
        v, w, last = start / np.linalg.norm(start), starts[0], 0.0
        for _ in range(_CLIMBS):
            across = np.einsum("k,i,kij->j", v, v, tensor)
            length = float(np.linalg.norm(across))
            if length == 0.0:
                break
            w = across / length
            # The quadratic form in v has its largest value at its last eigenvector.
            form = np.einsum("kij,j->ki", both, w)
            values, vectors = np.linalg.eigh(form)
            v = vectors[:, -1] if values[-1] >= -values[0] else vectors[:, 0]
            if length <= last * (1.0 + 1e-14):
                break
            last = length
        value = float(np.linalg.norm(np.einsum("k,i,kij->j", v, v, tensor)))
        if value > best:
            across = np.einsum("k,i,kij->j", v, v, tensor)
            best, directions = value, (v, across / value if value > 0.0 else w)
    return directions
