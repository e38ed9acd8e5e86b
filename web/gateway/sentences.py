"""Sentences for values that are refused: the reasons of pydantic in words of the operator.

A refusal names the value as the page does ("margin"), says what was expected with its unit, and
never shows what was sent. The key itself is in `error.where`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

LABELS = {
    "x_m": "x",
    "y_m": "y",
    "yaw_rad": "heading",
    "max_speed_mps": "speed limit",
    "min_confidence": "threshold",
    "min_height_m": "smallest height",
    "max_height_m": "largest height",
    "min_size_m": "smallest size",
    "max_size_m": "largest size",
    "expires_in_s": "time until it expires",
    "expires_at_s": "time of expiry",
    "kind": "rule",
    "class_name": "class",
    "geometry": "outline",
    "coordinates": "outline",
    "features": "list of zones",
    "loop": "repeat",
}
"""Names of values for operators; every other key is its own name without its unit."""
UNITS = {"_m": "m", "_mps": "m/s", "_rad": "rad", "_radps": "rad/s", "_s": "s"}
EXPECTED = {
    "finite_number": "a finite number",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text",
    "string_unicode": "text",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
    "model_attributes_type": "an object",
    "dataclass_type": "an object",
    "string_pattern_mismatch": "another form of text",
    "timezone_aware": "a time with its time zone",
    "datetime_from_date_parsing": "a time with its time zone",
    "datetime_parsing": "a time with its time zone",
    "int_parsing_size": "a whole number",
}
"""What was expected, by the kind of the error."""
ALTERNATIVES = {
    "literal_error": "expected",
    "enum": "expected",
    "union_tag_invalid": "expected_tags",
}
"""Where pydantic lists what it expected, by the kind of the error."""
BOUNDS = {
    "greater_than_equal": ("ge", "{label}: at least {limit}."),
    "less_than_equal": ("le", "{label}: at most {limit}."),
    "greater_than": ("gt", "{label}: more than {limit}."),
    "less_than": ("lt", "{label}: less than {limit}."),
}
COUNTS = {
    "string_too_long": ("max_length", "{label}: at most {limit} characters."),
    "string_too_short": ("min_length", "{label}: at least {limit} characters."),
    "too_long": ("max_length", "{label}: at most {limit} entries."),
    "too_short": ("min_length", "{label}: at least {limit} entries."),
}


def first_sentence(error: ValidationError) -> str:
    """Return the sentence for the first error in a document."""
    first = error.errors()[0]
    return sentence_of(first, first["loc"])


def sentence_of(error: Mapping[str, Any], parts: Sequence[str | int]) -> str:
    """Return the sentence for an error of pydantic at the key path `parts`, with the indices of
    lists as whole numbers."""
    kind, context = str(error.get("type")), error.get("ctx") or {}
    if kind == "union_tag_not_found":
        kind, parts = "missing", [*parts, "type"]
    label = _label(parts)
    if kind == "missing":
        return f"{_capital(label)} is missing."
    if kind == "extra_forbidden":
        return f"“{parts[-1]}” is not known here."
    if kind == "string_too_short" and context.get("min_length") == 1:
        return f"Give an {label}." if label[:1] in "aeiou" else f"Give a {label}."
    if kind in COUNTS:
        name, text = COUNTS[kind]
        return text.format(label=_capital(label), limit=context.get(name))
    if kind in BOUNDS:
        name, text = BOUNDS[kind]
        limit = f"{_number(context.get(name))}{_unit(parts)}"
        return text.format(label=_capital(label), limit=limit)
    if kind in ALTERNATIVES:
        return f"{_capital(label)}: expected {context.get(ALTERNATIVES[kind])}."
    if kind in EXPECTED:
        expected = "a colour as #rrggbb" if parts[-1:] == ["colour"] else EXPECTED[kind]
        return f"{_capital(label)}: expected {expected}."
    if kind != "value_error":
        return f"{_capital(label)} is not valid."
    text = str(error.get("msg")).removeprefix("Value error, ")
    # A check of this project that is a sentence by itself, or a phrase about the value.
    return text if text[:1].isupper() else f"{_capital(label)}: {text}."


def _label(parts: Sequence[str | int]) -> str:
    """Return the name of a value, with the number of its entry in a list."""
    names = [part for part in parts if isinstance(part, str)]
    name = names[-1] if names and names[-1] not in ("body", "query", "path") else "request"
    label = LABELS.get(name, name.removesuffix(_suffix(name)).replace("_", " "))
    entry = next((part + 1 for part in parts if isinstance(part, int)), None)
    return label if entry is None else f"{label} of entry {entry}"


def _suffix(name: str) -> str:
    found = [suffix for suffix in UNITS if name.endswith(suffix)]
    return max(found, key=len, default="")


def _unit(parts: Sequence[str | int]) -> str:
    suffix = _suffix(str(parts[-1])) if parts else ""
    return f" {UNITS[suffix]}" if suffix else ""


def _number(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
