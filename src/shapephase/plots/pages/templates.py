"""Pages from templates, with the styles, scripts and data that they need written into them."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import zlib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ...letters import printable
from .page import Page

_PACKAGE = "shapephase.plots.pages"
SCENE_SCRIPTS = ("packed", "linear", "geometry", "scene3d", "clock", "kinematics", "figure3d", "player")
"""Scripts of a page with a moving body, in this order."""
# Content security policy: figures are data of the page, scripts and styles are known by their hashes, and no request
# leaves the page.
_POLICY = (
    "default-src 'none'; script-src {scripts}; style-src {styles}; img-src data:; base-uri 'none'; form-action 'none'"
)
_ALIGNMENT = 8  # [bytes] of arrays, as browsers need them
_COMPRESSION = 6  # of 9: more is much slower and hardly smaller
# Characters that would end the element around the text, and how JSON can write them.
_ESCAPES = str.maketrans({"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"})


def page_from(
    template: str,
    *,
    title: str,
    scripts: Sequence[str],
    styles: Sequence[str],
    data: Mapping[str, Any],
    film: tuple[float, float] | None = None,
    **shown: Any,
) -> Page:
    """Return a page that needs no other file.

    template : name of a file of `templates/`
    scripts, styles : names of files of `static/`, without their endings, in the order in which they are read
    data : for the scripts
    film : duration and speed of the motion to film
    shown : for the template, all text of which is escaped
    """
    title = printable(title)
    script_texts = [_static(f"{name}.js") for name in scripts]
    style_texts = [_static(f"{name}.css") for name in styles]
    text, arrays = _packed(data)
    html = (
        _environment()
        .get_template(template)
        .render(
            title=title,
            policy=_POLICY.format(scripts=_hashes(script_texts), styles=_hashes(style_texts)),
            scripts=[Markup(script) for script in script_texts],
            styles=[Markup(style) for style in style_texts],
            data=Markup(text),
            arrays=Markup(arrays),
            **shown,
        )
    )
    return Page(title, html, data, *(film or ()))


@lru_cache(maxsize=1)
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader(_PACKAGE, "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # Names that people gave are shown so that they can be printed, and read from left to right.
    environment.finalize = lambda value: printable(value) if type(value) is str else value
    return environment


@lru_cache(maxsize=64)
def _static(name: str) -> str:
    return (files(_PACKAGE) / "static" / name).read_text(encoding="utf-8")


def _hashes(texts: Sequence[str]) -> str:
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in texts)
    return " ".join(f"'sha256-{digest}'" for digest in digests) or "'none'"


def _packed(data: Mapping[str, Any]) -> tuple[str, str]:
    """Return JSON of data, and in base 64 one compressed block of the bytes of all arrays in it.

    Names are written as they can be printed, and numbers that are not finite become null.
    """
    block = bytearray()
    text = json.dumps(_plain(data, block, {}), separators=(",", ":"))
    return text.translate(_ESCAPES), base64.b64encode(zlib.compress(bytes(block), _COMPRESSION)).decode()


def _plain(value: Any, block: bytearray, known: dict[int, Any]) -> Any:
    if isinstance(value, np.ndarray):
        if id(value) not in known:  # visuals of one file share their arrays
            start = len(block)
            block += np.ascontiguousarray(value).tobytes()
            block += bytes(-len(block) % _ALIGNMENT)
            known[id(value)] = {"array_kind": value.dtype.name, "start": start, "length": value.size}, value
        return known[id(value)][0]
    if isinstance(value, Mapping):
        return {key: _plain(entry, block, known) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry, block, known) for entry in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return printable(value) if isinstance(value, str) else value
