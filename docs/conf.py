"""How the site is built: sphinx-build -W docs out/site.

Nothing on its pages comes from another machine: Furo brings its own fonts and scripts, and MathJax is one file of the
package sphinx-mathjax-offline.
"""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

import rbimpedance

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "docs" / "gallery"
MATHJAX = Path(str(find_spec("sphinx-mathjax-offline").origin)).parent / "static/mathjax/tex-svg.js"

project = "rbimpedance"
author = copyright = "The rbimpedance developers"
version = release = rbimpedance.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
]
default_role = "py:obj"  # `Impedance` in a docstring leads to its description

html_theme = "furo"
html_title = f"rbimpedance {version}"
html_static_path = [str(MATHJAX), "site.css", "gallery/push.html"]
html_css_files = ["site.css"]
html_copy_source = False
mathjax_path = MATHJAX.name
mathjax3_config = {"options": {"enableMenu": False}, "svg": {"mtextInheritFont": True}}

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_type_aliases = {
    name: name for name in ("Array", "ArrayLike", "BoolArray", "Environment", "TimeFunction")
}
add_module_names = False
napoleon_numpy_docstring = False
napoleon_use_ivar = True

# The gallery is drawn where some of it is missing; to draw it anew: python -m benchmarks.pictures.gallery docs/gallery
shown = re.findall(r"gallery/([\w.]+)", (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8"))
if not all((GALLERY / name).exists() for name in [*shown, "push.html"]):
    subprocess.run(
        [sys.executable, "-m", "benchmarks.pictures.gallery", GALLERY], cwd=ROOT, check=True
    )


def without_described_fields(
    app: Sphinx, what: str, name: str, member: Any, skip: bool, options: Any
) -> bool | None:
    """Leave out the fields of tuples, which their class describes already."""
    del app, what, name, skip, options
    return (
        True if inspect.ismemberdescriptor(member) or "_tuplegetter" in repr(type(member)) else None
    )


def with_plain_names(
    app: Sphinx, what: str, name: str, member: Any, options: Any, call: str | None, back: str | None
) -> tuple[str | None, str | None]:
    """Write the names of types as the source does, where Sphinx shows its own stand-in for them."""
    del app, what, name, member, options
    plain = [
        text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text) for text in (call, back)
    ]
    return plain[0], plain[1]


def with_literal_blocks(
    app: Sphinx, what: str, name: str, member: Any, options: Any, lines: list[str]
) -> None:
    """Show equations and code, which docstrings set off by an indent alone, as they stand."""
    del app, what, name, member, options
    for i in range(len(lines) - 1, 1, -1):
        before = lines[i - 2]
        is_set_off = lines[i].startswith(" ") and not lines[i - 1].strip()
        if is_set_off and before.strip() and before[0] not in " -*0123456789":
            lines[i:i] = ["::", ""]


def with_its_colon(
    app: Sphinx, what: str, name: str, member: Any, options: Any, lines: list[str]
) -> None:
    """Give a value's description back what Napoleon took for its type: all before a colon."""
    del app, name, member, options
    kind = next((line for line in lines if line.startswith(":type: ")), None)
    if what in ("attribute", "data", "property") and kind is not None:
        lines.remove(kind)
        lines[0] = f"{kind.removeprefix(':type: ')}: {lines[0]}"


def found_by_its_last_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    """Resolve the bare name of something in another module, where there is only one of that name."""
    if node.get("refdomain") != "py":
        return None
    python = env.domains.python_domain
    wanted = "." + node["reftarget"]
    found = [
        name
        for name, entry in python.objects.items()
        if name.endswith(wanted) and not entry.aliased
    ]
    if len(found) != 1:
        return None
    return python.resolve_xref(env, node["refdoc"], app.builder, "obj", found[0], node, content)


def setup(app: Sphinx) -> None:
    """Connect the above."""
    app.connect("autodoc-skip-member", without_described_fields)
    app.connect("autodoc-process-signature", with_plain_names)
    app.connect("autodoc-process-docstring", with_literal_blocks, priority=400)  # before Napoleon
    app.connect("autodoc-process-docstring", with_its_colon, priority=900)  # after Napoleon
    app.connect("missing-reference", found_by_its_last_name)
