"""bioMod models of the acrobatics community, as biorbd (Michaud and Begon 2021) reads them.

Segments, frames, masses and ranges come from biorbd; the text itself is searched only for what biorbd ignores in
silence. Coordinates of the root segment are the free base.
"""

from __future__ import annotations

import difflib
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import biorbd
import numpy as np

from ...arrays import Array
from ..couplings.ball_joints import coordinate_names
from ..formats.xml_text import listed, quoted
from .chain import (
    EXACT,
    FRAME_ERRORS,
    Chain,
    UnusableModelError,
    check_name,
    inertia_and_momentum,
    rates_by_differences,
)

_AXES = dict(zip("xyz", np.eye(3), strict=True))
# Words of a segment in lower case, by biorbd 1.12.
_WORDS = (
    *("parent", "rt", "rtinmatrix", "translations", "rotations", "ranges", "rangesq", "rangesqdot", "rangesqddot"),
    *("jointdampings", "mass", "com", "centerofmass", "inertia", "inertiamatrix", "inertia_xxyyzz"),
    *("mesh", "meshfile", "meshcolor", "meshscale", "meshrt", "meshrtinmatrix", "patch"),
    *("externalforceindex", "forceplate"),
)
# Numbers of values after a word: biorbd ignores further ones, and the last letters of `1,5`.
_COUNTS = {
    **dict.fromkeys(("parent", "translations", "rotations", "rtinmatrix", "mass"), 1),
    **dict.fromkeys(("com", "centerofmass", "inertia_xxyyzz"), 3),
    **dict.fromkeys(("inertia", "inertiamatrix"), 9),
}
_FRAME = 16  # values of a frame as a matrix; otherwise three angles, the order of their axes, three coordinates
_ONCE = (*_COUNTS, "rt", "rangesq")  # a second one would replace the first; meshes have many points
_OF_NUMBERS = ("rt", "rangesq", "mass", "com", "centerofmass", "inertia", "inertiamatrix", "inertia_xxyyzz")
_OPERAND = r"(\$\w+|[Pp][Ii]|(\d+\.?\d*|\.\d+)(e[+-]?\d+)?|[+-]?(nan|NaN|inf|Infinity))"
# What biorbd reads correctly: `5E-1` is 5 - 1 for it, `2^3` is 2, `5d1` is 5, and functions crash it.
_VALUE = re.compile(rf"[+-]?(\(+[+-]?)?{_OPERAND}\)*([-+*/]\(*{_OPERAND}\)*)*", re.ASCII)
_DROPPED = ("meshfile", "meshcolor", "meshscale", "meshrt")  # biorbd refuses missing meshes, which do not affect turns
_QUATERNION = "_Quat"  # ending of a ball joint after its segment's name; biorbd's numbers have X, Y, Z and Z behind it
_COARSE = 1e-9  # share of the largest terms in a momentum by differences: short quaternions turn fast
_NO_ROOT = ("root", "base")
_MASSLESS = 1e-7  # [kg] biorbd gives a segment without mass 1e-8 kg


def chain_of(path: str, root_body: str | None = None) -> Chain:
    """Links and joints of a bioMod file, on its root segment.

    root_body : the root segment that floats, with all that hangs on it, where the file has several
    """
    notes: list[str | tuple[str, str, str]] = []
    starts: dict[str, int] = {}
    model = _model(path, notes, starts)
    chain = Chain(Path(path).stem, notes=notes)
    segments = _tree(model, root_body, notes, starts)
    base, dropped = _base(model, segments)
    way = [model.segment(segments[name]) for name in (*dropped, base)]
    _name_base(chain, way)
    if chain.base_angles is None or chain.base_slides is None:
        _add_way(chain, way)
    if dropped:
        named = ", ".join(map(repr, dropped))
        which, has = ("segment", "has") if len(dropped) == 1 else ("segments", "have")
        notes.append(f"{which} {named} {has} no mass: their coordinates are the free base's, as those of {base!r}")
    for name in dropped:
        del segments[name]
    lack, flips = 0.0, {}
    for name, number in segments.items():
        segment, line = model.segment(number), starts.get(name, 1)
        parent = segment.parent().to_string()
        frame = segment.localJCS().to_array()
        above = flips.get(parent, np.eye(3))
        turn, flips[name], missing = _orthonormal(above @ frame[:3, :3], name, line)
        if flips[name][2, 2] < 0.0:
            if segment.nbDof() or name == base:
                raise UnusableModelError(
                    f"segment {name!r}: the frame of a mirror is no base, and no joints move in it", line
                )
            message = "with the frame of a mirror, where mass is taken over as biorbd sees it"
            notes.append(("segment", repr(name), message))
        traits, flip = segment.characteristics(), flips[name]
        tensor = flip @ traits.inertia().to_array() @ flip
        chain.add_link(name, traits.mass(), flip @ traits.CoM().to_array(), tensor, line)
        if name == base:
            continue
        lack = max(lack, missing)
        chain.add_joints(parent, name, above @ frame[:3, 3], turn, _axes(segment, name), line)
    if lack > EXACT:
        notes.append(f"frames are orthonormal to {lack:.1g} only: the nearest rotations are taken")
    _add_poses(chain, model, segments, base, lack)
    return chain


def _model(path: str, notes: list[Any], starts: dict[str, int]) -> Any:
    """The model, without its meshes; lines at which segments begin go to `starts`."""
    content = Path(path).read_bytes()
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    kept = _without_meshes(text, notes, starts)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "model.bioMod"
        copy.write_text(kept, encoding="utf-8")
        try:
            return biorbd.Model(str(copy))
        except Exception as error:
            # The bindings turn what was thrown into whatever fits.
            raise _refused(str(error), starts) from None


def _refused(message: str, starts: dict[str, int]) -> UnusableModelError:
    """The error of biorbd in one line, at the segment that it names."""
    text = " ".join(message.split("Alternatively")[0].split())
    named = re.search(r"Element: segment, named: (\S+)", " ".join(message.split()))
    reason = re.sub(r'^Reading of file "[^"]*" failed with the following error: ', "", text)
    segment = f"segment {named[1]!r}: " if named else ""
    return UnusableModelError(f"{segment}biorbd does not accept it: {reason}", starts.get(named[1], 1) if named else 1)


@dataclass
class _Segment:
    """A segment of the text on the way through it: words and values with their lines."""

    name: str
    entries: list[tuple[str, int]]

    def fault(self, message: str, line: int) -> UnusableModelError:
        return UnusableModelError(f"segment {self.name!r}: {message}", line)

    def add_line(self, words: list[str], line: int) -> None:
        """Add the words of a line. Raises UnusableModelError for an unknown word, or axes with blanks between."""
        word = words[0].lower()
        value = not re.match(r"[a-z]", word) or word.startswith(("pi", "nan", "inf"))
        if word not in _WORDS and len(words) > 1 and not value:
            near = difflib.get_close_matches(word, _WORDS, 1)
            meant = f"; {near[0]!r} is near" if near else ""
            raise self.fault(f"biorbd ignores the word {words[0]!r}{meant}", line)
        if word in ("rotations", "translations") and len(words) > 2:
            meant = f"{words[0]} {''.join(words[1:])}"
            raise self.fault(f"of `{' '.join(words)}` biorbd reads {words[1]!r} alone; write `{meant}`", line)
        self.entries += [(text, line) for text in words]

    def check(self, end: int) -> None:
        """Raise UnusableModelError for values that biorbd would ignore, or read in part."""
        values: dict[str, list[str]] = {}
        word, start = "", 1
        for text, line in [*self.entries, ("", end)]:
            named = text.lower() in _WORDS and not (word == "parent" and not values["parent"])
            if text and not named:
                if not word:
                    raise self.fault(f"{text!r} follows no word; write `word values`", line)
                values[word].append(text)
                continue
            self._check_count(word, values, start)
            word, start = text.lower(), line
            if values.setdefault(word, []) and word in _ONCE:
                raise self.fault(f"{text!r} stands twice; keep one", line)

    def _check_count(self, word: str, by_word: dict[str, list[str]], line: int) -> None:
        numbers = values = by_word.get(word, [])
        if word == "rt" and len(values) == 7:
            numbers = values[:3] + values[4:]
        elif word == "rt" and len(values) != _FRAME:
            raise self.fault(
                "RT is three angles, an order such as xyz and three coordinates, or a matrix of 16 numbers; got "
                f"{len(values)} values",
                line,
            )
        elif word in _COUNTS and len(values) != _COUNTS[word]:
            raise self.fault(f"{word} has {len(values)} values, not {_COUNTS[word]}", line)
        elif word == "rangesq":
            axes = sum(len("".join(by_word.get(kind, ()))) for kind in ("translations", "rotations"))
            if len(values) != 2 * axes:
                raise self.fault(f"rangesQ has {len(values)} values of {axes} coordinates", line)
        for text in numbers if word in _OF_NUMBERS else ():
            if not _VALUE.fullmatch(text):
                hint = "; write a small e" if re.fullmatch(r"[-+.\d]+E[-+\d]+", text) else ""
                raise self.fault(f"{word}: {text!r:.40} is not a number that biorbd reads{hint}", line)


def _without_meshes(text: str, notes: list[Any], starts: dict[str, int]) -> str:
    """The text without meshes. Raises UnusableModelError for what biorbd would ignore."""
    kept, segment, meshes, constraints, number = [], None, 0, 0, 1
    without_blocks = re.sub(r"/\*.*?\*/", lambda block: "\n" * block[0].count("\n"), text, flags=re.DOTALL)
    for number, line in enumerate(without_blocks.splitlines(), 1):
        words = line.split("//")[0].split()
        word = words[0].lower() if words else ""
        if any(word.startswith("/*") for word in words):
            raise UnusableModelError("a comment that begins with /* has no end; close it by */", number)
        kept.append("" if word in _DROPPED else line)
        if word in _DROPPED:
            meshes += word == "meshfile"
            if segment is not None:
                segment.entries.append((words[0], number))
        elif word == "segment":
            _check_closed(segment, number)
            segment = _Segment(words[1] if len(words) > 1 else "", [(text, number) for text in words[2:]])
            check_name(segment.name, f"segment {segment.name!r}", number)
            if segment.name in starts:
                raise UnusableModelError(f"two segments are named {segment.name!r}; rename one", number)
            starts[segment.name] = number
        elif word == "endsegment" and segment is not None:
            segment.check(number)
            segment = None
        elif word == "loopconstraint" and segment is None:
            constraints += 1
        elif segment is not None and word:
            segment.add_line(words, number)
    _check_closed(segment, number)
    if meshes:
        notes.append(f"{meshes} mesh files are not read: they have no part in how the body turns")
    if constraints:
        notes.append(f"{constraints} loop constraints are ignored, every joint is free to move")
    return "\n".join(kept) + "\n"


def _check_closed(segment: _Segment | None, line: int) -> None:
    """Raise UnusableModelError where a segment goes on, as in a file that is cut off."""
    if segment is not None:
        raise UnusableModelError(f"segment {segment.name!r} has no endsegment; add it", line)


def _tree(model: Any, root_body: str | None, notes: list[Any], starts: dict[str, int]) -> dict[str, int]:
    """The root segment and all that hangs on it, with their numbers."""
    known = {model.segment(k).name().to_string(): k for k in range(model.nbSegment())}
    parents = {name: model.segment(k).parent().to_string() for name, k in known.items()}
    for name, parent in parents.items():
        if parent not in known and parent.lower() not in _NO_ROOT:
            raise UnusableModelError(
                f"segment {name!r}: its parent {parent!r} does not exist; there is {listed([*known])}",
                starts.get(name, 1),
            )
    trees: dict[str, dict[str, int]] = {}
    for name, parent in parents.items():
        # A parent stands above its children in the file.
        tree = next((tree for tree in trees.values() if parent in tree), None)
        if tree is None:
            tree = trees[name] = {}
        tree[name] = known[name]
    masses = {
        root: sum(model.segment(k).characteristics().mass() for k in tree.values() if _has_mass(model, k))
        for root, tree in trees.items()
    }
    roots = [root for root, mass in masses.items() if mass > 0.0] or list(trees)
    names = listed([*map(repr, roots)]) or "none"
    if root_body is not None and root_body not in trees:
        raise UnusableModelError(f"root_body: {quoted(root_body)!r} is not a root segment; there is {names}")
    if len(roots) != 1 and root_body is None:
        heaviest = max(roots, key=lambda root: masses[root], default="")
        way = f"; say which one by root_body={heaviest!r} (--root-body {heaviest})" if roots else ""
        raise UnusableModelError(
            f"one root segment is needed, got {names}{way}", starts.get(roots[1], 1) if roots else 1
        )
    root = root_body or roots[0]
    if masses[root] == 0.0:
        raise UnusableModelError("no segment has mass; give them `mass` and `inertia`", starts.get(root, 1))
    if len(trees[root]) < len(known):
        notes.append(f"{len(known) - len(trees[root])} segments on other roots are left out")
    return trees[root]


def _has_mass(model: Any, number: int) -> bool:
    return not model.segment(number).characteristics().mass() <= _MASSLESS


def _base(model: Any, segments: dict[str, int]) -> tuple[str, list[str]]:
    """The segment that is the free base, and those above it that have no mass."""
    parents = {name: model.segment(k).parent().to_string() for name, k in segments.items()}
    base, dropped = next(iter(segments)), []
    while not _has_mass(model, segments[base]):
        below = [name for name, parent in parents.items() if parent == base]
        if len(below) != 1:
            break
        dropped.append(base)
        base = below[0]
    return base, dropped


def _name_base(chain: Chain, way: list[Any]) -> None:
    """The coordinates that move the base, where those of the segments on the way to it are seen along fixed axes."""
    frames = [segment.localJCS().to_array() for segment in way]
    if any(np.any(frame[:3, :3] != np.eye(3)) for frame in frames):
        return
    hinges = [(segment, axis) for segment in way for axis in segment.seqR().to_string()]
    letters = "".join(axis for _, axis in hinges)
    if sorted(letters) == list(_AXES) and not way[-1].isRotationAQuaternion():
        names = [f"{segment.name().to_string()}_Rot{axis.upper()}" for segment, axis in hinges]
        chain.base_angles = (names, letters)
    slides = {axis: segment for segment in way for axis in segment.seqT().to_string()}
    unturned = not any(segment.seqR().to_string() for segment in way[:-1])
    if list(slides) == list(_AXES) and unturned and not any(frame[:3, 3].any() for frame in frames):
        chain.base_slides = [f"{slides[axis].name().to_string()}_Trans{axis.upper()}" for axis in _AXES]


def _add_way(chain: Chain, way: list[Any]) -> None:
    """The joints that move the base, as of a planar root; none where they are not hinges and slides of a real frame."""
    moved, above = Chain(""), "root"
    for segment in way:
        name, frame = segment.name().to_string(), segment.localJCS().to_array()
        turn, flip, _ = _orthonormal(frame[:3, :3], name, 1)
        if segment.isRotationAQuaternion() or flip[2, 2] < 0.0:
            return
        moved.add_joints(above, name, frame[:3, 3], turn, _axes(segment, name))
        above = name
    if moved.moving():
        chain.base_joints, chain.base_angles, chain.base_slides = moved.joints, None, None


def _axes(segment: Any, name: str) -> list[tuple[str, str, Array, list[float] | None]]:
    """Slides, then hinges or a ball joint, each moved by those before it."""
    ranges = [[interval.min(), interval.max()] for interval in segment.QRanges()]
    ball = segment.isRotationAQuaternion()
    kinds = [("prismatic", "Trans", axis) for axis in segment.seqT().to_string()]
    kinds += [("revolute", "Rot", axis) for axis in segment.seqR().to_string() if not ball]
    axes: list[tuple[str, str, Array, list[float] | None]] = [
        (f"{name}_{word}{axis.upper()}", kind, _AXES[axis], limits)
        for (kind, word, axis), limits in zip(kinds, ranges, strict=not ball)
    ]
    return [*axes, (f"{name}{_QUATERNION}", "ball", _AXES["x"], None)] if ball else axes


def _orthonormal(matrix: Array, name: str, line: int) -> tuple[Array, Array, float]:
    """The nearest rotation, what makes a mirror of it if the matrix is one, and how far the matrix is from both."""
    left, values, right = np.linalg.svd(matrix)
    nearest = left @ right
    if not np.abs(values - 1.0).max() < 1e-2:
        fault = f"its frame {matrix.tolist()} is not a rotation; correct its RT"
        raise UnusableModelError(f"segment {name!r}: {fault}", line)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(nearest))])
    return nearest @ flip, flip, float(np.abs(matrix - nearest).max())


def _add_poses(chain: Chain, model: Any, segments: dict[str, int], base: str, lack: float) -> None:
    """Add inertia and momentum by biorbd with the base at rest."""
    names = [name.to_string() for name in model.nameDof()]
    still = np.zeros(model.nbQ())
    # The scalar parts of quaternions come last, in the order of the segments.
    still[model.nbQ() - model.nbQuat() :] = 1.0
    round_ones = [k for k in range(model.nbSegment()) if model.segment(k).isRotationAQuaternion()]
    scalars = {model.segment(k).name().to_string(): len(still) - len(round_ones) + n for n, k in enumerate(round_ones)}
    tolerance = EXACT + FRAME_ERRORS * lack

    def coordinates(shape: dict[str, float]) -> Array:
        q = still.copy()
        for joint in {name.rpartition(".")[0] for name in shape if name.rpartition(".")[0].endswith(_QUATERNION)}:
            four = np.array([shape[part] for part in coordinate_names(joint)])
            segment, first = joint.removesuffix(_QUATERNION), names.index(f"{joint}X")
            four /= np.sqrt(four @ four)
            q[first : first + 3], q[scalars[segment]] = four[:3], four[3]
        for name, value in shape.items():
            if name in names:
                q[names.index(name)] = value
        return q

    numbers = list(segments.values())
    traits = [model.segment(k).characteristics() for k in numbers]
    masses = np.array([part.mass() for part in traits])
    offsets = np.array([part.CoM().to_array() for part in traits])
    tensors = np.array([part.inertia().to_array() for part in traits])

    def frames(shape: dict[str, float]) -> Array:
        state = biorbd.GeneralizedCoordinates(coordinates(shape))
        return np.array([frame.to_array() for frame in model.allGlobalJCS(state)])

    def poses(shape: dict[str, float]) -> tuple[Array, Array]:
        own = frames(shape)[numbers]
        return own[:, :3, 3] + (own[:, :3, :3] @ offsets[:, :, None])[:, :, 0], own[:, :3, :3]

    for shape, rate in chain.random_shapes():
        state, v = biorbd.GeneralizedCoordinates(coordinates(shape)), np.zeros(model.nbQdot())
        for name in names[: len(v)]:
            v[names.index(name)] = rate.get(name, 0.0)
        velocities = biorbd.GeneralizedVelocity(v)
        root, coarse = frames(shape)[segments[base], :3, :3], tolerance
        if any(name.endswith(f"{_QUATERNION}.w") for name in shape):
            # biorbd leaves the rates of quaternions out.
            speeds, omega = rates_by_differences(poses, shape, rate)
            coarse = max(tolerance, _COARSE)
        else:
            # Part by part: not all segments need belong to the body.
            speeds = np.array([s.to_array() for s in model.CoMdotBySegment(state, velocities, True)])[numbers]
            omega = np.array([model.segmentAngularVelocity(state, velocities, k, False).to_array() for k in numbers])
        inertia, momentum = inertia_and_momentum(masses, tensors, *poses(shape), speeds, omega)
        chain.add_pose(shape, rate, root.T @ inertia @ root, root.T @ momentum, (tolerance, coarse))
