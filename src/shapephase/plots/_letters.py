"""Names of users as figures show them: letter by letter, whatever they are."""

from __future__ import annotations

from ..letters import printable

# Letters of a name in a figure: more would leave no room for the curves.
_MAX_LETTERS = 32


def plain_text(name: str) -> str:
    """A name as Matplotlib draws it letter by letter: no formulas; what is too long is shortened in its middle."""
    letters = printable(name)
    if len(letters) > _MAX_LETTERS:
        half = _MAX_LETTERS // 2
        letters = f"{letters[:half]}…{letters[-half:]}"
    # An underscore at the start would leave it out of legends; a hair space before it is not seen.
    return ("\u200a" if letters.startswith("_") else "") + letters.replace("$", r"\$")
