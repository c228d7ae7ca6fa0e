"""The device that a network learns on."""

import re

import torch

from loco_drake.common.errors import InputError, quoted


def find_device(name: str) -> torch.device:
    """Returns the device "cpu", "cuda" or, among several GPUs, such as "cuda:1".

    The CPU is the reference. Results on a GPU differ in their last bits, and training
    makes these grow.

    Raises:
        InputError: if there is no such device.
    """
    if not re.fullmatch(r"cpu|cuda(:\d+)?", name):
        raise InputError(
            f"Unknown device {quoted(name)}; the choices are cpu, cuda, and cuda:N for "
            "GPU number N."
        )
    device = torch.device(name)
    if device.type == "cuda":
        count = torch.cuda.device_count() if torch.cuda.is_available() else 0
        if (device.index or 0) >= count:
            found = f"has {count} such GPU(s)" if count else "has no such GPU"
            raise InputError(
                f"This machine {found} for --device {name}, or its PyTorch cannot use "
                "it; leave out --device to learn on the CPU."
            )
    return device
