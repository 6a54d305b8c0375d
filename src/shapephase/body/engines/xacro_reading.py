"""xacro files, as xacrodoc expands them: includes, macros, properties and expressions become a URDF."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from xacrodoc import XacroDoc
from xacrodoc import packages as finder

from .chain import UnusableModelError


def text_of(path: str, packages: Sequence[str] = ()) -> str:
    """The URDF of a file.

    packages : folders in which packages are looked for, by the names of their folders or by their `package.xml`
    """
    folders = [Path(folder) for folder in packages]
    for folder in folders:
        if not folder.is_dir():
            raise UnusableModelError(f"<robot>: packages: {str(folder)[:60]!r} is no folder")
    finder.look_in([str(folder) for folder in folders])
    inside = {part.name: part for folder in folders for part in (folder.absolute(), *folder.iterdir()) if part.is_dir()}
    finder.update_package_cache(inside)
    # Files that are included are named as seen from it.
    with contextlib.chdir(Path(path).parent):
        try:
            return XacroDoc.from_file(path, resolve_packages=False).dom.toxml()
        except MemoryError:
            raise
        except Exception as error:
            # Of an expression anything may be thrown.
            said = " ".join(str(error).split()) or type(error).__name__
            raise UnusableModelError(f"<robot>: xacro does not accept it: {said[:400]}") from None
