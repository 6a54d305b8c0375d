"""One vocabulary, that of the field: names that were given up do not come back, and constants stand alone."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "src" / "shapephase"
# The name given up, and what says the same in the words of the field.
GIVEN_UP = {
    "march": "step_loop, integrate_steps",
    "March": "StepRecord",
    "marched": "integrate_steps",
    "growth": "error_propagator",
    "exact_growth": "exact_propagators",
    "Needs": "StepRequirements",
    "step_plan": "step_control",
    "caution": "safety_factor",
    "Source": "Description",
    "Original": "UngaugedDescription",
    "sources": "descriptions",
    "ModelCard": "BodySummary",
    "model_card": "body_summary",
    "PathCard": "PathSummary",
    "path_card": "path_summary",
    "JointCard": "JointSummary",
    "cards": "summaries",
    "beyond": "joints_beyond_limits",
    "resting": "still_joints",
    "asked": "evaluate",
    "wanted": "expected_shape",
    "told": "report",
    "heard": "iteration_callback",
    "tale": "message",
    "called": "call_casadi",
    "for_rows": "map_rows",
    "in_machine_code": "engine.is_ready",
    "Judgement": "SpectralEstimate",
    "judged": "estimate_spectrum",
    "Tail": "estimate_tail",
    "calm": "at_noise_floor",
    "Followed": "BestIterate",
    "Watch": "IterationCallback",
    "Watched": "IterationCallback",
    "Solved": "NlpSolution",
    "solved": "solve_linear",
    "miss": "goal_error",
    "pace": "rate_limit",
    "ties": "coupling",
    "still": "fixed_joints",
    "RigidInOwnTime": "TimeReparametrisedRigid",
    "wild": "near_pole",
    "tame": "regular",
    "size": "magnitude, or the name of what is counted",
}

# Of these also local variables: they have no other meaning here than the one that was given up.
NOT_EVEN_LOCAL = {"asked", "calm", "heard", "march", "miss", "pace", "tale", "ties", "told", "wanted"}


def named(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Functions, classes, parameters, fields, attributes and some variables that a module defines, with their lines."""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                yield node.name, node.lineno
            case ast.ClassDef():
                yield node.name, node.lineno
                for part in node.body:
                    if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
                        yield part.target.id, part.lineno
            case ast.arg():
                yield node.arg, node.lineno
            case ast.Attribute(value=ast.Name(id="self"), ctx=ast.Store()):
                yield node.attr, node.lineno
            case ast.Name(ctx=ast.Store()) if node.id.strip("_") in NOT_EVEN_LOCAL:
                yield node.id, node.lineno


def packed(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Constants that share an assignment at the top of a module, with their lines."""
    for node in tree.body:
        if isinstance(node, ast.Assign):
            names = [part.id for target in node.targets for part in ast.walk(target) if isinstance(part, ast.Name)]
            several = len(node.targets) > 1 or isinstance(node.targets[0], ast.Tuple | ast.List)
            if several and any(re.fullmatch(r"_*[A-Z][A-Z0-9_]*", name) for name in names):
                yield ", ".join(names), node.lineno


@pytest.fixture(scope="module")
def modules() -> list[tuple[str, list[tuple[str, int]], list[tuple[str, int]]]]:
    """Of each module its path, the names that it defines, and its constants that share an assignment."""
    found = []
    for file in sorted(file for file in ROOT.rglob("*") if file.suffix in (".py", ".pyi")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        found.append((str(file.relative_to(ROOT)), [*named(tree), (file.stem, 0)], [*packed(tree)]))
    return found


def test_no_name_that_was_given_up_is_defined(modules):
    found = [
        f"{place}:{line}: {name} (say {GIVEN_UP[name.strip('_')]})"
        for place, names, _ in modules
        for name, line in names
        if name.strip("_") in GIVEN_UP
    ]
    assert not found, "\n".join(found)


def test_every_constant_has_a_line_of_its_own(modules):
    """No A, B = 1, 2 at the top of a module: each constant has a unit and a reason to be stated."""
    found = [f"{place}:{line}: {names}" for place, _, constants in modules for names, line in constants]
    assert not found, "\n".join(found)


def test_the_search_finds_what_it_is_for():
    tree = ast.parse(
        "class Tail:\n    miss: float\n    def f(self, size, *, told=1):\n        self._calm = size\n        tale = 0\n"
    )
    assert {name.strip("_") for name, _ in named(tree)} == {"Tail", "miss", "f", "self", "size", "told", "calm", "tale"}
    assert [names for names, _ in packed(ast.parse("_A, _B = 1, 2\nx, y = f()\nC = 3\nD, _ = f()\n"))] == [
        "_A, _B",
        "D, _",
    ]
