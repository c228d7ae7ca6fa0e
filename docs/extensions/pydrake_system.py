"""Renders the ports of a system, as Drake's docstrings declare them, as tables.

.. pydrake_system::

name: Steering
input_ports:
- plan: abstract, Plan
output_ports:
- followed: vector (3,), the command as far as it is followed; m/s, rad/s
"""

from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive


class PydrakeSystem(Directive):
    """The directive; its content is YAML."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Returns a table of input and one of output ports."""
        # Not read as YAML: a description may hold a colon.
        ports: dict[str, list[list[str]]] = {"input_ports": [], "output_ports": []}
        kind = None
        for line in self.content:
            text = line.strip()
            if text.removesuffix(":") in ports:
                kind = text.removesuffix(":")
            elif text.startswith("- ") and kind:
                name, _, description = text[2:].partition(":")
                ports[kind].append([name.strip(), description.strip()])
            elif text and kind:
                ports[kind][-1][1] += f" {text}"
            elif text and not text.startswith("name:"):
                raise self.error(f"A line is no part of a system: {text!r}")
        titles = {"input_ports": "Input port", "output_ports": "Output port"}
        return [_table(titles[kind], rows) for kind, rows in ports.items() if rows]


def _table(title: str, rows: list[list[str]]) -> nodes.table:
    group = nodes.tgroup(cols=3)
    group += [nodes.colspec(colwidth=width) for width in (20, 20, 60)]
    head, body = nodes.thead(), nodes.tbody()
    head += _row(title, "type", "meaning")
    for name, description in rows:
        type_, _, meaning = _split(description)
        body += _row(nodes.literal(text=name), type_, meaning)
    group += [head, body]
    table = nodes.table(classes=["ports"])
    table += group
    return table


def _split(description: str) -> tuple[str, str, str]:
    """Splits "vector (3,), command; m/s" behind the type and its size."""
    if description.startswith("vector ("):
        end = description.index(")") + 1
        return description[:end], ",", description[end:].lstrip(",; ")
    return description.partition(", ")


def _row(*cells: str | nodes.Node) -> nodes.row:
    row = nodes.row()
    for cell in cells:
        paragraph = nodes.paragraph()
        paragraph += cell if isinstance(cell, nodes.Node) else nodes.Text(cell)
        entry = nodes.entry()
        entry += paragraph
        row += entry
    return row


def setup(app: Any) -> dict[str, bool]:
    """Registers the directive."""
    app.add_directive("pydrake_system", PydrakeSystem)
    return {"parallel_read_safe": True}
