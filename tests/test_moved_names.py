"""The changelog's table of moved names leads to names that exist."""

from __future__ import annotations

import dataclasses
import importlib
import inspect

import pytest

from support.moved_names import rows_of_changelog

ROWS = rows_of_changelog()


def found(name: str) -> object:
    """The object of a dotted name; for a field or a parameter the class or function that has it."""
    name, _, parameter = name.removesuffix(")").partition("(")
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            holder: object = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        break
    for part in parts[count:]:
        fields = {field.name for field in dataclasses.fields(holder)} if dataclasses.is_dataclass(holder) else set()
        named = getattr(holder, "_fields", ())
        holder = holder if part in fields or part in named else getattr(holder, part)
    if parameter:
        assert parameter in inspect.signature(holder).parameters
    return holder


def test_the_table_is_there():
    assert len(ROWS) > 650
    assert len({old for old, _ in ROWS}) == len(ROWS)
    assert all(old != new for old, new in ROWS)


@pytest.mark.parametrize("room", sorted({new.split(".")[1] for _, new in ROWS}))
def test_every_new_name_exists(room):
    for _, new in ROWS:
        if new.split(".")[1] == room:
            assert found(new) is not None, new
