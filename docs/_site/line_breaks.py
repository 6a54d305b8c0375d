"""Where lines of a page may break: between parts of a long name, and not in an option, a number or before a comma."""

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
# A parameter in a signature of one line, with the comma or the bracket behind it.
_PARAMETER = re.compile(
    r'(?<!<dd>)(<em class="sig-param">(?:(?!</em>).)*</em>)(,|<span class="sig-paren">\)</span>)', re.DOTALL
)
# A browser breaks a line after the hyphen of 1e-9 and of -pi.
_SIGNED = re.compile(r"(?<![\w.\-/])\d+(?:\.\d+)?e-\d+(?![^<>]*>)|(?<=[ (\[,=])-[A-Za-z]\w*(?![^<>]*>)")
_NO_TEXT = re.compile(r'(<(span|div) class="math .*?</\2>|<pre>.*?</pre>|<script.*?</script>)', re.DOTALL)
# NumPy's arrays in the types of attributes, which no event of the build sees.
_TAGS = r"(?:</?span[^>]*>|\s)*"
_SPELT_OUT = ["ndarray", r"\[", "tuple", r"\[", "Any", ",", r"\.\.\.", r"\]", ",", "dtype", r"\["]
_KIND = r"(float64|complex128|int64|bool)"
_ARRAY = re.compile(f'<span class="pre">{_TAGS.join([*_SPELT_OUT, _KIND])}{_TAGS}\\]{_TAGS}\\]</span></span>')
_ALIASES = {"int64": "Integers", "bool": "Mask"}
_ENTRY = re.compile(r'(?<=">)[\w.]+(?=</a>)')


def with_line_breaks(body: str) -> str:
    """The HTML of a page with these places marked."""
    body = _ARRAY.sub(lambda array: f'<span class="pre">{_ALIASES.get(array[1], "Array")}</span>', body)
    body = _PARAMETER.sub(r'<span class="parameter">\1\2</span>', body)
    body = _TABLE.sub(lambda table: _WORD.sub(_with_breaks, table[0]), body)
    for names in (_DEFINED, _LONG_WORD, _HEADING):
        body = names.sub(_with_breaks, body)
    body = _OPTION.sub(lambda option: f'<span class="unbroken">{option[0]}</span>', body)
    body = _FORMULA.sub(_kept_together, body)
    parts, end = [], 0
    for other in _NO_TEXT.finditer(body):
        parts += [_SIGNED.sub(_unbroken, body[end : other.start()]), other[0]]
        end = other.end()
    return "".join([*parts, _SIGNED.sub(_unbroken, body[end:])])


def contents_with_breaks(contents: str) -> str:
    """The HTML of the table of contents beside a page, with breaks between the parts of names."""
    return _ENTRY.sub(_with_breaks, _WORD.sub(_with_breaks, contents))


def _unbroken(text: re.Match[str]) -> str:
    return f'<span class="unbroken">{text[0]}</span>'


def _with_breaks(name: re.Match[str]) -> str:
    return _BETWEEN_PARTS.sub(lambda gap: f"{gap[0]}<wbr>", name[0])


def _kept_together(formula: re.Match[str]) -> str:
    return f'<span class="unbroken">{formula[0]}</span>' if formula[1] or formula[3] else formula[0]
