"""Pages from templates, with the styles, scripts and data that they need written into them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from .._letters import printable
from .packing import packed
from .policy import page_policy

_PACKAGE = "shapephase.plots.pages"
SCENE_SCRIPTS = ("packed", "linear", "geometry", "scene3d", "clock", "kinematics", "figure3d", "player")
"""What a page with a moving body needs, in this order."""


def page_html(
    template: str, *, title: str, scripts: Sequence[str], styles: Sequence[str], data: Mapping[str, Any], **shown: Any
) -> str:
    """A page that needs nothing else.

    Parameters
    ----------
    template : name of a file of `templates/`
    scripts, styles : names of files of `static/`, without their endings, in the order in which they are read
    data : for the scripts
    shown : for the template, all text of which is escaped
    """
    script_texts = [_static(f"{name}.js") for name in scripts]
    style_texts = [_static(f"{name}.css") for name in styles]
    text, arrays = packed(data)
    return (
        _environment()
        .get_template(template)
        .render(
            title=title,
            policy=page_policy(script_texts, style_texts),
            scripts=[Markup(script) for script in script_texts],
            styles=[Markup(style) for style in style_texts],
            data=Markup(text),
            arrays=Markup(arrays),
            **shown,
        )
    )


@lru_cache(maxsize=1)
def _environment() -> Environment:
    made = Environment(
        loader=PackageLoader(_PACKAGE, "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # What is shown of names that people gave can be printed, and reads from left to right.
    made.finalize = lambda value: printable(value) if type(value) is str else value
    return made


@lru_cache(maxsize=64)
def _static(name: str) -> str:
    return (files(_PACKAGE) / "static" / name).read_text(encoding="utf-8")
