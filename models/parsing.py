"""Parsing of the models of robots."""

import re
from pathlib import Path

from pydrake.multibody.parsing import Parser
from pydrake.multibody.tree import ModelInstanceIndex

from .meshes import convert_meshes

_MODELS = Path(__file__).parent


def ConfigureParser(parser: Parser, *, visual: bool = True) -> None:
    """Registers the packages in the models' URLs with ``parser``.

    Those of the meshes are included if ``visual``; the first time this takes some
    seconds, see :mod:`loco_drake.models.meshes`.
    """
    parser.package_map().AddPackageXml(str(_MODELS / "package.xml"))
    if visual:
        parser.package_map().AddPackageXml(str(convert_meshes() / "package.xml"))


def AddUrdf(
    parser: Parser, *, url: str = "", model: str = "", visual: bool
) -> ModelInstanceIndex:
    """Adds the URDF at ``url``, package://..., or the text ``model`` to a plant.

    Without what is only to be seen, and its meshes, parsing is five times as fast.
    """
    if url:
        ConfigureParser(parser, visual=visual)
        if visual:
            (instance,) = parser.AddModels(url=url)
            return instance
        model = Path(parser.package_map().ResolveUrl(url)).read_text()
    if not visual:
        model = re.sub(r"<visual>.*?</visual>", "", model, flags=re.DOTALL)
    (instance,) = parser.AddModelsFromString(file_contents=model, file_type="urdf")
    return instance
