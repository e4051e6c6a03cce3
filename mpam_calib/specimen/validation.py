"""From parsed TOML to a validated declaration; pydantic's verdicts put into our own words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from mpam_calib.errors import InputError
from mpam_calib.specimen.declaration import Declaration, FileKind
from mpam_calib.specimen.effect_ids import forms_of_id, known_effect_ids
from mpam_calib.specimen.tables import TABLES
from mpam_calib.specimen.toml_source import TomlSource
from mpam_calib.specimen.wording import did_you_mean, listed, quoted, shown

_BOUNDS = {
    "greater_than": ("gt", "above"),
    "greater_than_equal": ("ge", "at or above"),
    "less_than": ("lt", "below"),
    "less_than_equal": ("le", "at or below"),
}
_KINDS_OF_VALUE = {
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "bool_type": "true or false",
    "string_type": "text in quotes",
    "string_too_short": "text that is not empty",
    "string_too_long": "a single character",
    "tuple_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
}


def validate(source: TomlSource) -> Declaration:
    """Check every table, key, value, effect id and mapped column.

    Raises ``InputError`` for the first fault.
    """
    try:
        declaration = Declaration.model_validate(source.tables)
    except ValidationError as error:
        # A misspelt key also leaves the right one missing: the spelling is the news.
        errors = sorted(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")
        raise _in_our_words(source, errors[0]) from None
    _check_effects(source, declaration)
    _check_mapped_columns(source, declaration)
    return declaration


def fault(source: TomlSource, keys: Sequence[str], found: str, expected: str) -> InputError:
    """An error about the key ``keys`` of the declaration, with its line where that is known."""
    return InputError(source.file, found, expected, source.line_of(keys), ".".join(keys) or None)


def _in_our_words(source: TomlSource, error: ErrorDetails) -> InputError:
    keys = _keys_in_file(source.tables, error["loc"], error["type"])
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    table, name = keys[:-1], keys[-1] if keys else ""
    if kind == "extra_forbidden":
        known = list(_model_of(table).model_fields)
        where = f"[{'.'.join(table)}]" if table else "the file"
        what = f'the unknown key "{name}"' if not isinstance(value, dict) else f"the unknown table [{name}]"
        return fault(source, keys, what + did_you_mean(name, known), f"in {where} one of {listed(known)}")
    if name == "tensile_strain" and kind in ("missing", "too_long"):
        return fault(source, keys, f"a list of {len(value)}", "two numbers, from and to")
    if kind == "missing":
        return _missing(source, keys)
    if table == ["files"] and value == []:  # of the two that may stand there, the error tells of a name alone
        return fault(source, keys, "an empty list", "at least one file's name")
    found = shown(value)
    if kind == "literal_error":
        words = re.findall(r"'([^']*)'", str(context["expected"]))
        return fault(source, keys, found + did_you_mean(str(value), words), f"one of {listed(words)}")
    if kind == "value_error":
        found, _, expected = str(context["error"]).partition("|")
        return fault(source, keys, found, expected)
    if kind in _BOUNDS:
        return fault(source, keys, found, _range_words(keys, kind, context))
    if kind in ("too_short", "too_long"):
        return fault(source, keys, f"a list of {context['actual_length']}", _length_words(context))
    expected = _KINDS_OF_VALUE.get(kind, error["msg"][:1].lower() + error["msg"][1:])
    if isinstance(value, str) and "number" in expected:
        found, expected = f"the text {found}", f"{expected} (without quotes)"
    return fault(source, keys, found, expected)


def _missing(source: TomlSource, keys: Sequence[str]) -> InputError:
    table, name = keys[:-1], keys[-1]
    needed = [key for key, field in _model_of(table).model_fields.items() if field.is_required()]
    if not table:
        return InputError(source.file, f"no table [{name}]", f"[{name}] with its keys", column=name)
    found = f'no key "{name}" in [{".".join(table)}]'
    return InputError(source.file, found, listed(needed), source.line_of(table), ".".join(keys))


def _range_words(keys: Sequence[str], kind: str, context: dict[str, Any]) -> str:
    if keys[-1].startswith("alpha0") and "sd" not in keys:
        return "an angle between 0 and 90 degrees, from the hoop direction"
    name, word = _BOUNDS[kind]
    return f"a value {word} {context[name]:g}"


def _length_words(context: dict[str, Any]) -> str:
    if "min_length" in context:
        return f"at least {context['min_length']}"
    return f"at most {context['max_length']}"


def _keys_in_file(tables: dict[str, Any], loc: Sequence[str | int], kind: str) -> list[str]:
    """The part of pydantic's location that exists in the file (it also names union members)."""
    keys: list[str] = []
    node: Any = tables
    for key in loc:
        if isinstance(node, dict) and isinstance(key, str) and (key in node or kind == "missing"):
            keys.append(key)
            node = node.get(key, {})
        else:
            break
    return keys


def _model_of(table: Sequence[str]) -> type[BaseModel]:
    """The model that describes a table."""
    model: type[BaseModel] = Declaration
    for key in table:
        annotation = model.model_fields[key].annotation if key in model.model_fields else None
        inner = [part for part in (annotation, *get_args(annotation)) if isinstance(part, type)]
        models = [part for part in inner if issubclass(part, BaseModel)]
        nested = [part for outer in get_args(annotation) for part in get_args(outer)]
        models += [part for part in nested if isinstance(part, type) and issubclass(part, BaseModel)]
        if models:
            model = models[0]
    return model


def _check_effects(source: TomlSource, declaration: Declaration) -> None:
    known = known_effect_ids()
    keys = ["simulation", "effects"]
    effects = declaration.simulation.effect_ids
    for effect, written in zip(effects, declaration.simulation.effects, strict=True):
        forms = forms_of_id(effect)
        form = written.partition(":")[2]
        if effect in known and ":" in written and form not in forms:
            found = f"{quoted(written)}{did_you_mean(form, forms)}"
            raise fault(source, keys, found, f"{quoted(effect)} or one of its forms: {listed(forms)}")
        if effect not in known:
            found = f"the unknown effect {quoted(effect)}{did_you_mean(effect, known)}"
            raise fault(source, keys, found, f"ids among {listed(known, limit=len(known))}")
        if effects.count(effect) > 1:
            raise fault(source, keys, f"{quoted(effect)} twice", "every effect once")


def _check_mapped_columns(source: TomlSource, declaration: Declaration) -> None:
    for kind in get_args(FileKind):
        known = TABLES[kind].columns + TABLES[kind].unread
        for name, column in declaration.columns.of(kind).items():
            keys = ["columns", kind, name]
            if name not in known:
                found = f"the unknown column {quoted(name)}{did_you_mean(name, known)}"
                raise fault(source, keys, found, f"one of {listed(known)}")
            if name == "branch" and (column.scale != 1.0 or column.offset != 0.0):
                raise fault(source, keys, "a scale or offset for words", "only a name")
