"""JSON and YAML as typed values, with errors that name the field."""

import reprlib
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

_NAMES = {str: "text", bool: "true or false", int: "a whole number"}


class FieldError(ValueError):
    """Says of a ``field`` what it must be; the message has no full stop."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message)
        self.field = field


def convert(
    value: Any, kind: Any, where: str = "it", *, numeric_text: bool = False
) -> Any:
    """Returns JSON or YAML as a value of a type.

    Args:
        value: mappings, lists and scalars.
        kind: a dataclass, whose fields with a default may be missing; a dict by str,
            list, tuple or union; or Path, str, float, int, bool, None or Any.
        where: name of the value in messages; "it" for the whole.
        numeric_text: whether a float may be text, as PyYAML reads 1e-3.

    Raises:
        FieldError: if a field is unknown, missing or of the wrong type.
    """

    def wrong(needed: str) -> FieldError:
        return FieldError(where, f"{where} must be {needed}, not {_short(value)}")

    def inner(item: Any, kind: Any, name: str) -> Any:
        return convert(item, kind, name, numeric_text=numeric_text)

    origin, of = get_origin(kind), get_args(kind)
    if origin in (UnionType, Union):
        errors = []
        for choice in of:
            try:
                return inner(value, choice, where)
            except FieldError as error:
                errors.append(error)
        raise errors[0]
    if is_dataclass(kind):
        known = {field.name: field for field in fields(kind)}
        choices = ", ".join(sorted(known))
        if not isinstance(value, dict):
            raise wrong(f"a mapping of {choices}")
        for key in value:
            if key not in known:
                unknown = f"{where} has the unknown field {_short(key)}"
                raise FieldError(_inside(where, key), f"{unknown}; there are {choices}")
        for key, field in known.items():
            required = field.default is MISSING and field.default_factory is MISSING
            if required and key not in value:
                raise FieldError(_inside(where, key), f"{where} lacks {key}")
        hints = get_type_hints(kind)
        return kind(  # type: ignore[operator]
            **{k: inner(v, hints[k], _inside(where, k)) for k, v in value.items()}
        )
    if origin is dict:
        if not isinstance(value, dict):
            raise wrong("a mapping by name")
        return {str(k): inner(v, of[1], _inside(where, k)) for k, v in value.items()}
    if origin in (list, tuple):
        any_length = origin is list or of[-1] is ...
        if not isinstance(value, list) or not (any_length or len(value) == len(of)):
            raise wrong("a list" if any_length else f"a list of {len(of)}")
        kinds = of[:1] * len(value) if any_length else of
        item = f"an item of {where}"
        return origin([inner(x, k, item) for x, k in zip(value, kinds, strict=True)])
    if kind is Path:
        return Path(inner(value, str, where))
    if kind is float:
        numbers = (int, float, str) if numeric_text else (int, float)
        try:
            if isinstance(value, numbers) and not isinstance(value, bool):
                return float(value)
        except (ValueError, OverflowError):
            pass
        raise wrong("a number")
    # True is an int to Python.
    if kind is not Any and type(value) is not kind:
        raise wrong(_NAMES.get(kind, "null"))
    return value


def _inside(where: str, key: object) -> str:
    return str(key)[:60] if where == "it" else f"{where}.{str(key)[:60]}"


def _short(value: object) -> str:
    text = reprlib.repr(value)  # of aliases within aliases only so much
    return text if len(text) <= 60 else f"{text[:57]}..."
