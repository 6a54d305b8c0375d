"""The documentation site: `make docs` writes it to docs/_build/html, and it needs no network there."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.inspect import TypeAliasForwardRef

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
_LOG = logging.getLogger(__name__)

from _site.code_links import with_links, with_targets
from _site.coverage import write_tables
from _site.docstrings import (
    defaults_by_value,
    entries_are_descriptions,
    formulas_are_text,
    own_names,
    public_parameters,
    returned_type,
    returned_values_are_descriptions,
    types_by_name,
)
from _site.equations import citing, with_citations
from _site.executed_notebooks import library_digest, quiet_kernels, write_pages
from _site.forked_kernels import fork_kernels
from _site.gallery_rows import with_rows
from _site.line_breaks import contents_with_breaks, with_line_breaks
from _site.live_pages import write_live_pages
from _site.name_links import places, with_linked_names, with_names
from _site.reference_pages import constant_documentation, write_reference

import shapephase

project = "shapephase"
author = "The shapephase authors"
project_copyright = "The shapephase authors"
version = release = shapephase.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinxcontrib.bibtex",
]
exclude_patterns = ["_build", "_site", "jupyter_execute", "theory/tables"]
templates_path: list[str] = []
numfig = True
math_numfig = True
# A name, a link or an equation that leads nowhere is an error (-W), also in a docstring.
nitpicky = True
nitpick_ignore_regex = [
    # Other libraries' pages are not on this site, and a build without network cannot look them up.
    ("py:.*", r"(numpy|np|scipy|pinocchio|pin|casadi|ca|matplotlib|pandas|pd|xarray)\..*"),
    ("py:.*", r"(pathlib|collections|concurrent|typing|types|os)\..*"),
    # In signatures: names that stand for a union of types or a kind of function, which the docstring spells out; and
    # classes that no face exports, which results hold and nobody makes.
    ("py:class", r"_?[A-Z]\w*"),
    ("py:class", r"shapephase\.\w+\.(\w+\.)*_?[A-Z]\w*"),
]

myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
# Without a cache: two processes that read pages would make its database at once.
nb_execution_mode = "auto"
nb_execution_raise_on_error = True
# Notebooks come executed, and compared with the outputs that are committed.
nb_execution_excludepatterns = ["tutorials/notebooks/*"]
# A page's few lines of code, on a busy machine.
nb_execution_timeout = 600
# Pages are read, and so executed, anew when they or the library change.
library = library_digest()
nb_merge_streams = True

autosummary_generate = False
autodoc_default_options = {
    "members": True,
    # Methods of a base class of our own are on the page of the class that users have.
    "inherited-members": "object,BaseException,Sequence,Mapping,tuple,str,int,Protocol,Enum,OSError,ImportError",
}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
_ALIASES = "Array ArrayLike Integers Mask Gauge Given Gradient Matrices Spinor Curve Evaluate Meridian Profile Stretch"
autodoc_type_aliases = {name: name for name in (*_ALIASES.split(), "Colour", "Directly", "RotorValue")}
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "unsrt"
bibtex_reference_style = "author_year"

html_theme = "pydata_sphinx_theme"
html_title = "shapephase"
LIVE = HERE / "_build" / "live"
html_static_path = ["_static", str(LIVE)]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
# A page without others beside it has no list of them.
html_sidebars = {"gallery": []}
html_theme_options = {
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "header_links_before_dropdown": 6,
}
# One file of npm's mathjax 3.2.2 (tex-svg: fonts are in it), with its licence beside it, so that pages open offline.
mathjax_path = "mathjax/tex-svg.js"
mathjax3_config = {"options": {"enableMenu": False}, "svg": {"fontCache": "global"}}


def _write_pages(*_: object) -> None:
    """Start what executes pages; write the reference, tables of the theory, live pages and executed notebooks."""
    quiet_kernels(HERE / "_build" / "ipython")
    fork_kernels()
    write_reference(HERE / "reference")
    write_tables(HERE.parent)
    write_live_pages(LIVE)
    for fault in write_pages(HERE / "tutorials" / "notebooks"):
        _LOG.warning("notebooks/%s", fault)


def _add_targets(_: Sphinx, page: str, source: list[str]) -> None:
    if page in ("theory", "numerics"):
        source[0] = with_targets(page, source[0])
    if page.startswith(("theory/", "explanation/")):
        source[0] = with_citations(source[0], citing(HERE / "reference"))
    if page.startswith(("theory/", "explanation/", "howto/")):
        source[0] = with_names(source[0], places(HERE / "reference"))
    if page == "gallery":
        source[0] = with_rows(source[0], HERE / "gallery" / "rows", places(HERE / "reference"))


def _plain_docstring(_app: Sphinx, what: str, name: str, found: Any, _options: Any, lines: list[str]) -> None:
    if what == "data":
        lines[:] = constant_documentation(name) or lines
    text = returned_values_are_descriptions("\n".join(lines), returned_type(found))
    text = entries_are_descriptions(formulas_are_text(text))
    own = own_names(_owner(name) if what == "attribute" else found)
    lines[:] = with_linked_names(with_links(text), places(HERE / "reference"), name, own).split("\n")


def _owner(name: str) -> Any:
    """The class that an attribute belongs to."""
    module, _, owner = name.rpartition(".")[0].rpartition(".")
    return getattr(sys.modules.get(module), owner, None)


def _plain_signature(*event: Any) -> tuple[str, str] | None:
    """Types by their names, of classes without private parameters; and none of a protocol, which nobody calls."""
    what, found, signature, returned = event[1], event[3], *event[-2:]
    if getattr(found, "_is_protocol", False):
        return "", ""
    if not (signature or returned):
        return None
    shown = defaults_by_value(types_by_name(signature or ""), found)
    return public_parameters(shown) if what == "class" and shown else shown, types_by_name(returned or "")


def _mark_line_breaks(_app: Sphinx, _page: str, _template: str, context: dict[str, Any], _tree: Any) -> None:
    if "body" in context:
        context["body"] = with_line_breaks(context["body"])
    if "toc" in context:
        context["toc"] = contents_with_breaks(context["toc"])


def setup(app: Sphinx) -> None:
    """Steps of the build that are this site's own."""
    # In signatures and types of attributes, an alias of a type goes by its name.
    TypeAliasForwardRef.__repr__ = lambda alias: alias.name  # type: ignore[method-assign]
    app.add_config_value("library", "", "env", str)
    app.connect("config-inited", _write_pages)
    app.connect("source-read", _add_targets)
    app.connect("html-page-context", _mark_line_breaks)
    app.connect("autodoc-process-signature", _plain_signature)
    # Before numpydoc, which makes sections of the text.
    app.connect("autodoc-process-docstring", _plain_docstring, priority=400)
