"""xacro files, as xacrodoc expands them: includes, macros, properties and expressions become a URDF."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import xacro
from xacrodoc import XacroDoc
from xacrodoc import packages as finder

from ..formats.xml_text import quoted, xml_text
from .chain import UnusableModelError

_USED = re.compile(r"\$\(\s*arg\s+([^\s)]+)\s*\)")
_TAG = re.compile(r"<xacro:arg\s[^>]*>")
_ATTRIBUTE = re.compile(r"""\b(name|default)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_UNDEFINED = re.compile(r"Undefined substitution argument (\S+)")


def text_of(path: str, packages: Sequence[str] = (), xacro_args: Mapping[str, str] | None = None) -> str:
    """The URDF of a file.

    packages : folders that are searched for packages, by the names of their folders or by their `package.xml`
    xacro_args : values of arguments, by name
    """
    given = dict(xacro_args or {})
    folders = [Path(folder) for folder in packages]
    for folder in folders:
        if not folder.is_dir():
            raise UnusableModelError(
                f"<robot>: packages: {quoted(str(folder))!r} is not a folder; name one that exists"
            )
    finder.look_in([str(folder) for folder in folders])
    inside = {part.name: part for folder in folders for part in (folder.absolute(), *folder.iterdir()) if part.is_dir()}
    finder.update_package_cache(inside)
    finder.walk_up_from(path)
    text = xml_text(Path(path).read_bytes(), path).lstrip()
    # Files that are included are named as seen from it.
    with contextlib.chdir(Path(path).parent):
        try:
            expanded = XacroDoc.from_string(text, subargs=given, resolve_packages=False).dom.toxml()
        except MemoryError:
            raise
        except Exception as error:
            # An expression may raise anything.
            message = " ".join(str(error).split()) or type(error).__name__
            undefined = _UNDEFINED.search(message)
            hint = _arguments_to_give(undefined[1], text, given) if undefined else ""
            raise UnusableModelError(f"<robot>: xacro does not accept it: {message[:400]}{hint}") from None
    unknown = sorted(set(given) - set(_declared(text)) - _named_in(text))
    if unknown:
        raise UnusableModelError(
            f"<robot>: the file has no argument {unknown[0]!r}; it has {_listed(text)}. Type --xacro NAME:=VALUE "
            "with one of them (Python: xacro_args)"
        )
    return expanded


def _texts(text: str) -> list[str]:
    """The file's and those of all that it included so far."""
    texts = [text]
    for path in dict.fromkeys(map(str, xacro.all_includes)):
        with contextlib.suppress(OSError):
            texts.append(Path(path).read_text(encoding="utf-8", errors="replace"))
    return texts


def _declared(text: str) -> dict[str, str | None]:
    """The arguments that the files declare, with their defaults."""
    defaults: dict[str, str | None] = {}
    for content in _texts(text):
        for tag in _TAG.findall(content):
            attributes = {name: first or second for name, first, second in _ATTRIBUTE.findall(tag)}
            if "name" in attributes:
                defaults.setdefault(attributes["name"], attributes.get("default"))
    return defaults


def _named_in(text: str) -> set[str]:
    """The arguments that the files use, declared or not."""
    return {name for content in _texts(text) for name in _USED.findall(content)}


def _listed(text: str) -> str:
    declared = _declared(text) | dict.fromkeys(_named_in(text) - set(_declared(text)))
    shown = [name if default is None else f"{name}:={default}" for name, default in declared.items()]
    return ", ".join(shown) or "none"


def _arguments_to_give(undefined: str, text: str, given: Mapping[str, str]) -> str:
    """A hint what to type for an argument without a value, and for others that would be missed next."""
    declared = _declared(text)
    valued = set(given) | {name for name, default in declared.items() if default is not None}
    missing = list(dict.fromkeys([undefined, *sorted((_named_in(text) | set(declared)) - valued)]))
    typed, python = (form.join(missing) for form in (":=VALUE ", '": "VALUE", "'))
    return (
        f"; arguments of the file: {_listed(text)}; type --xacro {typed}:=VALUE "
        f'(Python: xacro_args={{"{python}": "VALUE"}})'
    )
