"""Public .osim, .bioMod and measured bodies: what loads has been compared with its engine, what does not has a reason.

Nothing of them is kept here. BODY_MODELS names a folder with copies of the repositories opensim-org/opensim-models,
pyomeca/biorbd, pyomeca/bioptim and chrisdembia/yeadon; without it these tests are skipped.
"""

from __future__ import annotations

import os
import re
import warnings
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapePhaseError
from support import opensim_oracle

FOLDER = Path(os.environ.get("BODY_MODELS", "/nowhere"))
pytestmark = [
    pytest.mark.full,
    pytest.mark.skipif(not FOLDER.is_dir(), reason="BODY_MODELS is no folder of public models"),
    pytest.mark.skipif(find_spec("opensim") is None, reason="needs opensim"),
]
KINDS = {
    "osim": (r"\.osim$", 50),
    "biomod": (r"\.bioMod$", 60),
    "measurements": (r"(Meas|male\d|meas_output_des)\.txt$", 5),
}
"""Which files, and how many different ones load at least."""
REASONS = (
    *("is massless|has mass", "no segment has mass", "biorbd reads 'x' alone"),
    *("biorbd does not accept it: (All|axesNames|The 'recalculate')", "of any cut it is from 2 to pi times"),
)
"""Of the files that do not load."""


@cache
def loaded(kind: str) -> tuple[dict[Path, sp.Body], dict[Path, str]]:
    """Bodies and faults of the different files; the tree that a message names is asked for."""
    bodies, faults, seen = {}, {}, set()
    for path in sorted(FOLDER.rglob("*")):
        if not re.search(KINDS[kind][0], path.name) or (content := path.read_bytes()) in seen:
            continue
        seen.add(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            named: dict[str, str] = {}
            for _ in range(2):
                try:
                    bodies[path] = sp.load_body(path, **named)
                    break
                except ShapePhaseError as error:
                    faults[path] = str(error)
                    found = re.search(r"root_body='(\w+)'", str(error))
                    named = {"root_body": found[1]} if found else {}
    return bodies, {path: fault for path, fault in faults.items() if path not in bodies}


@pytest.mark.parametrize("kind", KINDS)
def test_public_bodies_load_or_say_why_not(kind):
    bodies, faults = loaded(kind)
    unexplained = {path: fault for path, fault in faults.items() if not any(re.search(one, fault) for one in REASONS)}
    assert not unexplained
    assert len(bodies) >= KINDS[kind][1], (len(bodies), faults)
    print(f"{kind}: {len(bodies)} load, {len(faults)} have a reason not to")


WHOLE = ("Rajagopal2016", "RajagopalLaiUhlrich2023", "FullBodyModel_Hamner2010_v2_0", "gait2392_thelen2003muscle")


@pytest.mark.parametrize("name", WHOLE)
def test_a_whole_body_floats_with_opensims_momentum(name, rng):
    bodies, _ = loaded("osim")
    body = next(body for path, body in bodies.items() if path.stem == name)
    low, high = np.clip(body.joint_limits, -1.0, 1.0).T
    free = [f"pelvis_{word}" for word in ("tilt", "list", "rotation", "tx", "ty", "tz")]
    shapes, rates = rng.uniform(low, high, (3, body.n_shape)), rng.normal(size=(3, body.n_shape))
    values = rng.uniform(-1.0, 1.0, (3, 6)), rng.normal(size=(3, 6))
    named = [
        [dict(zip((*body.joint_names, *free), row.tolist(), strict=True)) for row in np.hstack(pair)]
        for pair in zip((shapes, rates), values, strict=True)
    ]
    for shape, rate, found in zip(shapes, rates, opensim_oracle.asked(body.file, "pelvis", *named), strict=True):
        inertia = body.locked_inertia(shape)
        momentum = inertia @ found["omega"] + body.internal_momentum(shape, rate)
        fast = np.linalg.norm(found["omega"]) + np.abs(rate).sum()
        np.testing.assert_allclose(inertia, found["inertia"], rtol=0, atol=1e-12 * np.abs(inertia).max())
        np.testing.assert_allclose(momentum, found["momentum"], rtol=0, atol=1e-12 * np.abs(inertia).max() * fast)
