"""Where lines of a page may break: between the parts of a long name, and not in an option or before a comma."""

from __future__ import annotations

import re

_TABLE = re.compile(r"<table.*?</table>", re.DOTALL)
_WORD = re.compile(r'(?<=<span class="pre">)[^<]+')
_LONG_WORD = re.compile(r'(?<=<span class="pre">)[^<]{30,}')
_DEFINED = re.compile(r'(?<=name"><span class="pre">)[^<]+')
_HEADING = re.compile(r"(?<=<h2>)[\w.]+")
_BETWEEN_PARTS = re.compile(r"(?<=\w)[_./:](?=\w|$)|(?<=[a-z])(?=[A-Z])")
# A browser breaks a line after each hyphen, also after the two of an option.
_OPTION = re.compile(r'(?<=<span class="pre">)-[\w-]+')
# MathJax makes boxes of formulas, beside which a browser breaks a line whatever the next letter is.
_FORMULA = re.compile(r'([(\[“]*)(<span class="math notranslate nohighlight">[^<]*</span>)([)\]”’,.;:!?]*)')


def with_line_breaks(body: str) -> str:
    """The HTML of a page with these places marked."""
    body = _TABLE.sub(lambda table: _WORD.sub(_with_breaks, table[0]), body)
    for names in (_DEFINED, _LONG_WORD, _HEADING):
        body = names.sub(_with_breaks, body)
    body = _OPTION.sub(lambda option: f'<span class="unbroken">{option[0]}</span>', body)
    return _FORMULA.sub(_kept_together, body)


def _with_breaks(name: re.Match[str]) -> str:
    return _BETWEEN_PARTS.sub(lambda gap: f"{gap[0]}<wbr>", name[0])


def _kept_together(formula: re.Match[str]) -> str:
    return f'<span class="unbroken">{formula[0]}</span>' if formula[1] or formula[3] else formula[0]
