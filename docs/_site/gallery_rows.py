"""Rows of the gallery: a picture beside what it shows and the code that draws it, which is read from a file."""

from __future__ import annotations

import re
from pathlib import Path

from .name_links import with_names

_ROW = re.compile(r"^:::\{row\} (\w+)\n(.*?)\n:::$", re.MULTILINE | re.DOTALL)
_LANGUAGES = {".py": "python", ".sh": "sh"}


def with_rows(text: str, folder: Path, names: dict[str, str]) -> str:
    """Return a page whose rows `:::{row} name` are grids, with names of the library as links.

    The first line of a row is its title, which describes the picture too; `folder` has a file of code for each row.
    """
    return _ROW.sub(lambda found: _grid(found[1], found[2], folder, names), with_names(text, names))


def _grid(name: str, text: str, folder: Path, names: dict[str, str]) -> str:
    title, _, rest = text.partition("\n")
    (code,) = folder.glob(f"{name}.*")
    return f"""::::{{grid}} 1 1 2 2
:gutter: 3
:class-container: gallery-row

:::{{grid-item}}
:columns: 12 12 5 5

```{{image}} gallery/{name}.png
:alt: {title}
```
:::

:::{{grid-item}}
:columns: 12 12 7 7

**{title}.** {with_names(rest, names)}

```{{literalinclude}} gallery/rows/{code.name}
:language: {_LANGUAGES[code.suffix]}
```
:::
::::"""
