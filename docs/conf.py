"""Configuration of Sphinx for the documentation site.

pip install ".[docs]"
python -m sphinx -W docs site
"""

import os
import re
import sys
from pathlib import Path
from typing import Any

from loco_drake import __version__

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "loco_drake"
author = "the authors of loco_drake"
release = version = __version__

extensions = [
    "myst_nb",
    "pydrake_system",
    "sphinx.ext.apidoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinxcontrib.mermaid",
]

# Markdown as GitHub shows it: pages read the same in both places.
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_fence_as_directive = ["mermaid"]
myst_heading_anchors = 4

# Notebooks run when the site is built; a cell that fails is an error.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300

# A page of each package, written to api/.
apidoc_modules = [
    {
        "path": "../loco_drake",
        "destination": "api",
        "exclude_patterns": ["../loco_drake/cli"],
        "follow_links": True,
        "module_first": True,
        "automodule_options": {"members", "show-inheritance", "ignore-module-all"},
    }
]
autodoc_member_order = "bysource"
autodoc_mock_imports = ["ray"]  # an extra
autodoc_typehints = "description"
autodoc_class_signature = "separated"
autodoc_inherit_docstrings = False  # LeafSystem's tell nothing of its children
# Several modules have a name in common; what is meant is the nearest one.
exclude_patterns = ["api/modules.rst"]
suppress_warnings = ["ref.python", "misc.highlighting_failure"]

html_theme = "furo"
html_title = f"loco_drake {version}"
copybutton_prompt_text = r"\$ "

# Pages that are elsewhere in the repository, where GitHub finds them.
_PAGES = {
    "../README.md": "index.md",
    "../CHANGELOG.md": "changelog.md",
    "../models/pretrained/MODEL_CARD.md": "model_card.md",
}


def setup(app: Any) -> None:
    """Connects what changes texts before they are parsed."""
    app.connect("source-read", _read_page)
    app.connect("include-read", _read_included)
    app.connect("autodoc-process-docstring", _as_restructured_text)
    app.connect("autodoc-skip-member", _skip_imported)


def _read_page(app: Any, name: str, content: list[str]) -> None:
    content[0] = _relinked(content[0])


def _read_included(app: Any, path: Any, parent: str, content: list[str]) -> None:
    """Makes links of a page of the repository relative to this folder."""
    place = (Path(app.srcdir) / path).resolve().parent

    def moved(link: re.Match[str]) -> str:
        if re.match(r"[a-z]+:|#", link[1]):
            return link[0]
        file, hash_, anchor = link[1].partition("#")
        target = os.path.relpath(place / file, app.srcdir)
        return f"]({target}{hash_}{anchor})"

    content[0] = _relinked(re.sub(r"\]\(([^)\s]+)\)", moved, content[0]))


def _relinked(text: str) -> str:
    for before, after in _PAGES.items():
        text = text.replace(f"]({before}", f"]({after}")
    return text


def _as_restructured_text(
    app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Shows formulas, which are indented after a colon, as they are.

    Elsewhere |x| is a norm, and no substitution.
    """
    inside = None  # indentation of the paragraph before a formula
    for k, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        if inside is not None and line and indent <= inside:
            inside = None
        if inside is None:
            lines[k] = line.replace("|", r"\|")
            after = lines[k + 1 : k + 3]
            if line.endswith(":") and len(after) == 2 and not after[0]:
                deeper = len(after[1]) - len(after[1].lstrip()) > indent
                if deeper and not line.endswith("::"):
                    lines[k] += ":"
                inside = indent if deeper else None


def _skip_imported(
    app: Any, what: str, name: str, obj: Any, skip: bool, options: Any
) -> bool | None:
    """Leaves out of the package's page what its modules' pages describe."""
    page = app.env.current_document.docname
    return True if page == "api/loco_drake" and what == "module" else None
