"""A body of hinges, written as a model of biorbd and of OpenSim."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.arrays import Array
from support import osim_models

OSIM_FREE = ("free_1", "free_2", "free_3", "free_4", "free_5", "free_6")


def _words(numbers: Array) -> str:
    return " ".join(repr(float(number)) for number in np.ravel(numbers))


def _frame_names(body: sp.Body) -> list[str]:
    links = {frame: link for link, (frame, _) in reversed(body.chain.link_frames.items())}
    return [links[frame] for frame in range(len(body.chain.masses))]


def biomod(body: sp.Body) -> str:
    """A model whose base moves by x, y, z and turns about x, y, z of the moved axes; hinges turn about z."""
    chain, names = body.chain, _frame_names(body)
    # Axes of each segment, but the base, such that z is that of its hinge.
    own = [np.eye(3), *(Rotation.align_vectors([0.0, 0.0, 1.0], axis)[0].as_matrix() for axis in chain.axes)]
    lines = ["version 4", ""]
    for k, name in enumerate(names):
        lines.append(f"segment {name}")
        if k:
            above = chain.parents[k - 1]
            turn, place = own[above] @ chain.turns[k - 1] @ own[k].T, own[above] @ chain.places[k - 1]
            rows = np.vstack([np.column_stack([turn, place]), [0.0, 0.0, 0.0, 1.0]])
            lines += [f"parent {names[above]}", "RTinMatrix 1", "RT", *map(_words, rows), "rotations z"]
        else:
            lines += ["translations xyz", "rotations xyz"]
        inertia = own[k] @ chain.inertias[k] @ own[k].T
        lines += [f"mass {_words(chain.masses[k])}", "inertia", *map(_words, inertia)]
        lines += [f"com {_words(own[k] @ chain.centres[k])}", "endsegment", ""]
    return "\n".join(lines)


def osim(body: sp.Body) -> str:
    """A model whose base moves by a FreeJoint with the coordinates OSIM_FREE."""
    chain, names = body.chain, _frame_names(body)
    assert not chain.slides.any()
    assert (chain.turns == np.eye(3)).all()
    bodies = []
    for k, name in enumerate(names):
        inertia = chain.inertias[k]
        entries = np.append(np.diag(inertia), inertia[[0, 0, 1], [1, 2, 2]])
        bodies.append(osim_models.body(name, float(chain.masses[k]), _words(chain.centres[k]), _words(entries)))
    free = [osim_models.coordinate(name, clamped=False) for name in OSIM_FREE]
    joints = [osim_models.joint("FreeJoint", "free", "ground", names[0], free)]
    for k, name in enumerate(chain.names):
        # It is in the place of that of the usual three axes which is nearest.
        hinge = osim_models.axis(
            int(np.abs(chain.axes[k]).argmax()), _words(chain.axes[k]), osim_models.line(1.0, 0.0), name
        )
        joints.append(
            osim_models.joint(
                "CustomJoint",
                f"{name}_joint",
                names[chain.parents[k]],
                names[k + 1],
                [osim_models.coordinate(name, clamped=False)],
                places=(_words(chain.places[k]), "0 0 0"),
                transform=osim_models.axes(hinge),
            )
        )
    return osim_models.model(bodies, joints)
