"""Columns of the place and attitude of the base, under the names that programs give them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from ...errors import TrajectoryError
from .labels import label

QUATERNION = "quaternion"
PLACE = "place"
MRP = "mrp"
VECTOR = "vector"
EULER = "euler"
_KINDS = {
    QUATERNION: ("q", "quat", "quaternion", "orientation", "rotation", "attitude", "rot", "att"),
    PLACE: ("p", "t", "r", "pos", "position", "trans", "translation", "location"),
    MRP: ("sigma", "mrp", "mrps"),
    VECTOR: ("rotvec", "rv", "axisangle"),
}
_KIND_OF = {word: kind for kind, words in _KINDS.items() for word in words}
_EULER = {"roll": "roll", "pitch": "pitch", "yaw": "yaw", "heading": "yaw"}
_BASE = frozenset(  # words before the kind that name no other part of the body
    ("base", "link", "root", "pelvis", "body", "pose", "odom", "odometry", "state", "states", "transform", "field")
) | {"free", "floating", "freeflyer"}
_FRAME = re.compile(r"[a-z]{1,2}")  # frames between a kind and its component, as in `p_RS_R_x`
_JOINED = re.compile(r"(q|quat|t|p|r|mrp|sigma|rotvec|pos)([wxyz]|\d)")
_SPLIT = re.compile(r"[/.\s_\[\]()]+")
CANONICAL = {  # kind -> component -> name of its column
    QUATERNION: {part: f"base_q{part}" for part in "xyzw"},
    PLACE: {part: f"base_{part}" for part in "xyz"},
    MRP: {part: f"base_mrp_{part}" for part in "123"},
    VECTOR: {part: f"base_rotvec_{part}" for part in "xyz"},
    EULER: {part: f"base_{part}" for part in ("roll", "pitch", "yaw")},
}
HINT = (  # in messages about columns of the base
    "columns of the base are base_x, base_y, base_z and base_qx, base_qy, base_qz, base_qw or base_roll, base_pitch, "
    "base_yaw or base_mrp_1, base_mrp_2, base_mrp_3"
)


class _Part(NamedTuple):
    """Parts of a label: the kind, the words before it, and the component as it is written there."""

    kind: str
    stem: tuple[str, ...]
    component: str


def base_names(targets: Mapping[str, str], own: Collection[str]) -> dict[str, str]:
    """Label -> the name of a column of the base, of all labels that complete a quaternion, a place and so on.

    targets : label -> the name that it goes by
    own : names of joints and columns that are known already

    Raises TrajectoryError for a quaternion numbered from 1, of which the number of the scalar part is not known.
    """
    families: dict[tuple[str, tuple[str, ...]], dict[str, str]] = {}
    for text, target in targets.items():
        part = None if target in own or label(target).name in own else _part(target)
        if part is not None:
            families.setdefault((part.kind, part.stem), {})[part.component] = text
    names: dict[str, str] = {}
    for (kind, _), texts in families.items():
        components = _components(kind, texts)
        if components is not None:
            names |= {texts[written]: CANONICAL[kind][part] for written, part in components.items()}
    return names


def _part(target: str) -> _Part | None:
    """The kind and the component of a label; None of one that is no part of the base."""
    plain = label(target).name
    rooted = "/" in plain or "." in plain
    tokens: list[str] = []
    for token in filter(None, _SPLIT.split(plain.lower())):
        joined = _JOINED.fullmatch(token)
        tokens += joined.groups() if joined is not None else (token,)
    if not tokens:
        return None
    *before, last = tokens
    if last in _EULER:
        return _Part(EULER, tuple(before), _EULER[last]) if _is_base(before, rooted) else None
    if last not in (*"wxyz", *"01234"):
        return None
    for k, word in enumerate(before):
        if word in _KIND_OF and all(map(_FRAME.fullmatch, before[k + 1 :])):
            # `t1` to `t3` may be torques or temperatures; `r_BN_N_1` is a place.
            if _KIND_OF[word] == PLACE and len(word) == 1 and last.isdigit() and not before[k + 1 :]:
                return None
            return _Part(_KIND_OF[word], tuple(before), last) if _is_base(before[:k], rooted) else None
    return _Part(PLACE, tuple(before), last) if last in "xyz" and set(before) <= _BASE else None


def _is_base(before: Iterable[str], rooted: bool) -> bool:
    """True if the words before a kind may be the base: known words, or the topic of a message."""
    words = list(before)
    return set(words) <= _BASE or (rooted and (not words or words[-1] in _BASE))


def _components(kind: str, texts: Mapping[str, str]) -> dict[str, str] | None:
    """Written component -> component, where all are there; numbers count from 0, with the scalar first, or from 1."""
    there = "".join(sorted(texts)) if kind != EULER else ""
    if kind == EULER:
        return {name: name for name in texts} if len(texts) == len(CANONICAL[EULER]) else None
    if kind == QUATERNION and there == "1234":
        first, last = texts["1"], texts["4"]
        raise TrajectoryError(
            f"quaternion {', '.join(texts[k] for k in '1234')}: its scalar part may be the first or the last; say "
            f"which: --names '{first}=qw' and so on, or '{first}=qx' to '{last}=qw' (names={{{first!r}: 'qw', ...}})"
        )
    numbered = {
        QUATERNION: {"0123": "wxyz"},
        PLACE: {"012": "xyz", "123": "xyz"},
        MRP: {"012": "123", "123": "123", "xyz": "123"},
        VECTOR: {"012": "xyz", "123": "xyz"},
    }[kind]
    plain = {QUATERNION: "wxyz", MRP: "", PLACE: "xyz", VECTOR: "xyz"}[kind]
    meant = plain if there == plain else numbered.get(there)
    return None if not meant else dict(zip(there, meant, strict=True))
