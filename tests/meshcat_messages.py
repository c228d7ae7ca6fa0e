"""What Meshcat's page sends when a control is used, in MessagePack."""

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
