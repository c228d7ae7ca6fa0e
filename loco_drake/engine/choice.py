"""The engine by its name on the command line."""

from loco_drake.common.errors import InputError, check_choice
from loco_drake.engine.executor import Executor
from loco_drake.engine.local import Local

ENGINES = ("local", "ray")


def make_executor(engine: str, workers: int, ray_address: str | None) -> Executor:
    """Returns an executor with a number of workers; an address is Ray's.

    Raises:
        InputError: if there is no such engine, ``workers`` is below 1, an address is
            given for another engine, or Ray is not installed.
    """
    check_choice("engine", engine, ENGINES)
    if engine == "ray":
        from loco_drake.engine.cluster import Ray

        return Ray(workers, ray_address)
    if ray_address is not None:
        raise InputError("--ray-address needs --engine ray.")
    return Local(workers)
