"""Show the commands: `aeolid-commands` asks the command line itself."""

from __future__ import annotations

from docutils import nodes
from prose import inline
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from aeolid.cli import reference


class Commands(SphinxDirective):
    """Show every sub-command with arguments, options and examples."""

    def run(self) -> list[nodes.Node]:
        """Return a section for each."""
        lines: list[str] = []
        for command in reference.commands():
            title = f"aeolid {command.name}"
            lines += [f".. _aeolid-{command.name}:", "", title, "-" * len(title), ""]
            lines += [".. code-block:: sh", "", f"   {command.usage}", ""]
            lines += [line for text in command.paragraphs for line in (inline(text), "")]
            lines += [f".. program:: {title}", ""]
            for parameter in command.parameters:
                lines += [f".. option:: {parameter.head.replace('/', ', ')}", "", f"   {inline(parameter.notes)}", ""]
            lines += ["Examples:", "", ".. code-block:: sh", "", *(f"   {example}" for example in command.examples), ""]
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_directive("aeolid-commands", Commands)
    return {"parallel_read_safe": True}
