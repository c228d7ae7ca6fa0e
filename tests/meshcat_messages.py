"""What Meshcat's page sends when a control is used, in MessagePack."""

import base64
import json
import re
import struct


def pack(value):
    """Returns None, numbers, short texts, lists and dicts in MessagePack."""
    if value is None:
        return b"\xc0"
    if isinstance(value, str):
        return b"\xd9" + bytes([len(value.encode())]) + value.encode()
    if isinstance(value, int):
        return b"\xd2" + struct.pack(">i", value)
    if isinstance(value, float):
        return b"\xcb" + struct.pack(">d", value)
    if isinstance(value, list):
        return b"\xdc" + struct.pack(">H", len(value)) + b"".join(map(pack, value))
    parts = [pack(k) + pack(v) for k, v in value.items()]
    return b"\xde" + struct.pack(">H", len(parts)) + b"".join(parts)


def click(meshcat, name):
    meshcat._InjectWebsocketMessage(pack({"type": "button", "name": name}))


def move(meshcat, name, value):
    message = {"type": "slider", "name": name, "value": value}
    meshcat._InjectWebsocketMessage(pack(message))


def gamepad(meshcat, *axes):
    """Sends the axes of a gamepad; none of them means that it was pulled out."""
    pad = {"index": 0, "button_values": [], "axes": list(map(float, axes))}
    message = {"type": "gamepad", "name": "", "gamepad": pad if axes else {}}
    meshcat._InjectWebsocketMessage(pack(message))


def unpack(data):
    """Returns the value in MessagePack that ``data`` begins with."""
    return _unpack(data, 0)[0]


# Of a first byte: format of what follows it, a number or a length, and what that is of.
_FORMATS = {
    0xC4: ("B", bytes),
    0xC5: (">H", bytes),
    0xC6: (">I", bytes),
    0xCA: (">f", None),
    0xCB: (">d", None),
    0xCC: ("B", None),
    0xCD: (">H", None),
    0xCE: (">I", None),
    0xCF: (">Q", None),
    0xD0: ("b", None),
    0xD1: (">h", None),
    0xD2: (">i", None),
    0xD3: (">q", None),
    0xD9: ("B", str),
    0xDA: (">H", str),
    0xDB: (">I", str),
    0xDC: (">H", list),
    0xDD: (">I", list),
    0xDE: (">H", dict),
    0xDF: (">I", dict),
}


def _unpack(data, k):
    """Returns the value at byte ``k`` and where the next one begins."""
    first, k = data[k], k + 1
    if first in (0xC0, 0xC2, 0xC3):
        return {0xC0: None, 0xC2: False, 0xC3: True}[first], k
    if first < 0x80 or first >= 0xE0:
        return (first if first < 0x80 else first - 0x100), k
    if first < 0xC0:
        kind = dict if first < 0x90 else list if first < 0xA0 else str
        number = first & (0x1F if kind is str else 0x0F)
    else:
        form, kind = _FORMATS[first]
        (number,) = struct.unpack_from(form, data, k)
        k += struct.calcsize(form)
    if kind is None:
        return number, k
    if kind in (str, bytes):
        part = bytes(data[k : k + number])
        return (part.decode() if kind is str else part), k + number
    values = []
    for _ in range(number * (2 if kind is dict else 1)):
        value, k = _unpack(data, k)
        values.append(value)
    if kind is dict:
        return dict(zip(values[::2], values[1::2], strict=True)), k
    return values, k


def animation(page):
    """Returns the tracks in a saved page: time in frames and value, by path and name.

    Args:
        page: the page's HTML.
    """
    parts = re.findall(r"base64,([A-Za-z0-9+/=]+)", page)
    packed = [p for p in map(base64.b64decode, parts) if b"set_animation" in p]
    (command,) = map(unpack, packed)
    return {
        (part["path"], track["name"]): [(k["time"], k["value"]) for k in track["keys"]]
        for part in command["animations"]
        for track in part["clip"]["tracks"]
    }


def captions(page):
    """Returns time in s and HTML of each caption of a saved page's replay."""
    (data,) = re.findall(r"atob\(&quot;(.*?)&quot;\)", page)
    return json.loads(base64.b64decode(data))
