"""XML elements whose numbers are written with all their digits."""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np


def add_element(parent: ET.Element, tag: str, **attributes: Any) -> ET.Element:
    """Adds an element to ``parent``; see :func:`value_text`."""
    return ET.SubElement(
        parent, tag, {name: value_text(value) for name, value in attributes.items()}
    )


def value_text(value: Any) -> str:
    """Returns text as it is, and a number or an array of them with all digits."""
    if isinstance(value, str):
        return value
    numbers = np.atleast_1d(value).astype(float).tolist()
    return " ".join(repr(number).removesuffix(".0") for number in numbers)
