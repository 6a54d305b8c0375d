"""Names that mean something to a browser, to Matplotlib or to a terminal, and bodies that have them."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np

import shapephase as sp

# A script that runs writes this into its window.
MARK = "window.owned"
# As a URDF may have them: with printable letters.
OF_FILES = (
    f"</script><script>{MARK}=1</script>",
    f"<img src=x onerror={MARK}=1>",
    f'"><svg onload={MARK}=1>',
    f"'><b onmouseover='{MARK}=1'>",
    f"<script>{MARK}=1</script>",
    "<!--",
    "-->",
    "<!--<script>",
    "]]>",
    "&lt;script&gt;",
    "&quot;",
    "</title><b>",
    "<style>*{display:none}</style>",
    "<base href='http://example.invalid/'>",
    "<meta http-equiv=refresh content='0;url=http://example.invalid/'>",
    f"';{MARK}=1;//",
    f"`{MARK}=1`",
    "\\u003cscript\\u003e",
    f"javascript:{MARK}=1",
    "http://example.invalid/x.png",
    "/../../etc/passwd",
    "a/b//c",
    "$x_$",
    "$\\foo$",
    "$",
    "\\$5$",
    "a_{b}^c%#~",
    "{} {0} %s %d",
    "_hidden",
    "__proto__",
    "constructor",
    "\U0001f600",
    "العربية",
    "e\u0301\u0327" * 20,
    "\u0e33" * 50,
    "x" * 256,
)
# As only a model or a caller may have them: controls, ends of lines, marks of direction, half a pair.
HALF_A_PAIR = "\ud800"
OF_MODELS = (
    "a\x01b",
    "\u2028",
    "a\u2029b",
    "\u202egnp.exe",
    "\u200b",
    "\ufeff",
    "\ue000",
    HALF_A_PAIR,
    "\x1b[2J",
    " ",
    "",
)
_INERTIA = "<inertial><mass value='1'/><inertia ixx='.1' iyy='.1' izz='.1' ixy='0' ixz='0' iyz='0'/></inertial>"


def star_urdf(names) -> str:
    """A body with a ball on a turning joint for each name, which joint and ball are called by."""
    parts = [f"<robot name='r'><link name='base'>{_INERTIA}</link>"]
    for k, name in enumerate(names):
        quoted = quoteattr(name)
        at = f"<origin xyz='{0.3 * k + 0.3} 0 0'/>"
        parts.append(
            f"<link name={quoted}>{_INERTIA}<visual>{at}<geometry><sphere radius='.1'/></geometry></visual></link>"
            f"<joint name={quoted} type='continuous'><parent link='base'/><child link={quoted}/><axis xyz='0 1 0'/>"
            "</joint>"
        )
    return "".join([*parts, "</robot>"])


def swinging(body) -> sp.ShapePath:
    """All joints of a body swing, each by its own angle."""
    joints = len(body.joint_names)
    swings = 0.1 + 0.2 * np.arange(joints)[:, None] / joints
    return sp.ShapePath.fourier(np.zeros(joints), 0.0 * swings, swings, 1.0, joint_names=body.joint_names)
