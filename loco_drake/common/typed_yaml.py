"""YAML files as typed dataclasses, with errors that name the field."""

import reprlib
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import yaml
from pydrake.common.yaml import yaml_load

from loco_drake.common.errors import InputError, quoted

T = TypeVar("T")

_MAX_BYTES = 100_000  # PyYAML reads some 100 kB/s
_MAX_REASON = 200


def read_yaml(path: Path, schema: type[T], what: str) -> T:
    """Returns the dataclass in a YAML file; missing fields have their default.

    Args:
        path: the file.
        schema: a dataclass of str, float, lists, dicts by str and other dataclasses,
            all with defaults.
        what: kind of file for messages, such as "a robot file".

    Raises:
        InputError: if the file does not exist or is not YAML, or a field is unknown or
            has the wrong type.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"There is no file {str(path)!r}; it should be {what}.")
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise InputError(f"it has more than {_MAX_BYTES // 1000} kB")
        text = path.read_text(encoding="utf-8-sig")
        refuse_repeated_keys(text)
        data = yaml_load(data=text) if text.strip() else {}
        result: T = _convert(data, schema, "it")
    except RecursionError:
        raise InputError(f"{path} is not {what}: it is nested too deeply.") from None
    except AttributeError:  # Drake asks keys how they begin
        raise InputError(f"{path} is not {what}: every key must be text.") from None
    except Exception as error:  # Drake and PyYAML raise many kinds
        reason = " ".join(str(error).split()).removesuffix(".")
        if len(reason) > _MAX_REASON and not isinstance(error, InputError):
            reason = reason[:_MAX_REASON] + "..."
        raise InputError(f"{path} is not {what}: {reason}.") from None
    return result


def refuse_repeated_keys(text: str) -> None:
    """Raises InputError if a mapping names a key twice, of which Drake takes the last.

    Raises:
        yaml.YAMLError: if it is no YAML.
    """
    nodes = [yaml.compose(text, Loader=yaml.SafeLoader)]
    seen: set[int] = set()
    for node in nodes:  # grows, by each node once, however many aliases it has
        if id(node) in seen:
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            nodes += node.value
        elif isinstance(node, yaml.MappingNode):
            names: set[str] = set()
            for key, value in node.value:
                name, line = str(key.value), key.start_mark.line + 1
                if name in names:
                    raise InputError(f"line {line} names {quoted(name)} a second time")
                names.add(name)
                nodes.append(value)


def _convert(value: Any, kind: Any, where: str) -> Any:
    """Returns ``value`` as ``kind``; raises InputError naming ``where``."""
    if isinstance(kind, UnionType):
        if value is None:
            return None
        kind = get_args(kind)[0]
    if is_dataclass(kind):
        known = {field.name for field in fields(kind)}
        rows = _mapping(value, where, f"of {', '.join(sorted(known))}")
        for key in rows:
            if key not in known:
                raise InputError(
                    f"{where} has the unknown field {_short(key)}; "
                    f"there are {', '.join(sorted(known))}"
                )
        hints = get_type_hints(kind)
        return kind(  # type: ignore[operator]
            **{k: _convert(v, hints[k], _inside(where, k)) for k, v in rows.items()}
        )
    if get_origin(kind) is dict:
        (_, inner) = get_args(kind)
        rows = _mapping(value, where, "by name")
        return {str(k): _convert(v, inner, _inside(where, k)) for k, v in rows.items()}
    if get_origin(kind) is list:
        if not isinstance(value, list):
            raise InputError(f"{where} must be a list, not {_short(value)}")
        (inner,) = get_args(kind)
        return [_convert(item, inner, f"an item of {where}") for item in value]
    if kind is float:
        # PyYAML takes 1e-3 for text.
        try:
            if isinstance(value, int | float | str) and not isinstance(value, bool):
                return float(value)
        except (ValueError, OverflowError):
            pass
        raise InputError(f"{where} must be a number, not {_short(value)}")
    if not isinstance(value, kind):
        raise InputError(f"{where} must be text, not {_short(value)}")
    return value


def _mapping(value: Any, where: str, of: str) -> dict[Any, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a mapping {of}, not {_short(value)}")
    return value


def _inside(where: str, key: object) -> str:
    return str(key)[:60] if where == "it" else f"{where}.{str(key)[:60]}"


def _short(value: object) -> str:
    text = reprlib.repr(value)  # of aliases within aliases only so much
    return text if len(text) <= 60 else f"{text[:57]}..."
