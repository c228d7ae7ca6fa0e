"""YAML files as typed dataclasses, with errors that name the field."""

from pathlib import Path
from typing import TypeVar

import yaml
from pydrake.common.yaml import yaml_load

from loco_drake.common.errors import InputError, quoted
from loco_drake.common.typed import FieldError, convert

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
        result: T = convert(data, schema, numeric_text=True)
    except RecursionError:
        raise InputError(f"{path} is not {what}: it is nested too deeply.") from None
    except AttributeError:  # Drake asks keys how they begin
        raise InputError(f"{path} is not {what}: every key must be text.") from None
    except Exception as error:  # Drake and PyYAML raise many kinds
        reason = " ".join(str(error).split()).removesuffix(".")
        if len(reason) > _MAX_REASON and not isinstance(error, InputError | FieldError):
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
