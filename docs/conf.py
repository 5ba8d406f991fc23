# SPDX-License-Identifier: MIT
"""Sphinx: the pages, the reference and the demos, which are run as they are, as one site.

What differs between the files as they are read in a repository and as pages of the site is here.
"""

import logging
import os
import re
import sys
from collections import defaultdict
from pathlib import Path

import jupytext
import latex2mathml.converter
import nbformat
from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.transforms import SphinxTransform

import ufl_beam as ub
import ufl_beam.structures as st

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))  # for "conf.read_demo"
os.environ["TQDM_DISABLE"] = "1"  # progress bars would be text on pages
logging.getLogger("traitlets").setLevel(logging.WARNING)  # of kernels of notebooks

project = "ufl_beam"
author = "The ufl_beam developers"
extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "myst_nb",  # brings myst_parser
    "sphinx_design",
    "sphinx_copybutton",
]
exclude_patterns = ["_build", "conf.py", "demos/README.md", "**/output", "requirements.txt"]
html_theme = "furo"
html_title = "ufl_beam"
html_favicon = "_static/favicon.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = html_show_copyright = html_show_sphinx = False
html_copy_source = False
ADDRESS = re.search(
    r'^Repository = "(.+)"', (DOCS.parent / "pyproject.toml").read_text("utf-8"), re.MULTILINE
)
"""The public address, if there is one."""
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#00598a", "color-brand-content": "#00598a"},
    "dark_css_variables": {"color-brand-primary": "#7cc4f0", "color-brand-content": "#7cc4f0"},
}

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88
napoleon_use_ivar = True

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_fence_as_directive = ["math"]  # ```math, as GitHub has it
myst_heading_anchors = 3

nb_custom_formats = {".py": "conf.read_demo"}
nb_execution_mode = "force"  # what demos show is computed by this version
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_merge_streams = True

SLOW = [
    "lattice", "flying_beam", "slider_crank", "tradeoff", "vibrating_frame", "four_beam_swing",
    "tumbling_beam", "right_angle_frame", "bricard",
]  # fmt: skip
if os.environ.get("UFL_BEAM_DEMOS") == "cheap":
    nb_execution_excludepatterns = [f"demos/demo_{name}.py" for name in SLOW]

# -- demos -----------------------------------------------------------------------------------------

SHOW_SAVED = """
from pathlib import Path as _P
from IPython import get_ipython as _g
from IPython.display import Image as _I, display as _d
_seen = {f: f.stat().st_mtime_ns for f in _P("output").glob("*.*")}
def _show(_result):
    for f in sorted(_P("output").glob("*.*"), key=lambda f: f.stat().st_mtime_ns):
        if f.suffix in (".png", ".gif") and _seen.get(f) != f.stat().st_mtime_ns:
            _seen[f] = f.stat().st_mtime_ns
            _d(_I(filename=str(f), alt=f.stem.replace("_", " ")))
_g().events.register("post_run_cell", _show)
"""


def read_demo(text):
    """A script in percent format as a notebook that shows the pictures each of its cells saves."""
    notebook = jupytext.reads(text.replace("# SPDX-License-Identifier: MIT\n", ""), "py:percent")
    first = nbformat.v4.new_code_cell(SHOW_SAVED, metadata={"tags": ["remove-cell"]})
    notebook.cells.insert(0, first)
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3"}
    notebook.metadata["language_info"] = {"name": "python", "pygments_lexer": "python"}
    return notebook


def gallery():
    """The table of demos as cards with titles and pictures, of shapes if there are any.

    Documents are read in the order of their names, so the demos have been run before.
    """
    text = (DOCS / "demos" / "README.md").read_text(encoding="utf-8")

    def card(row):
        script, topic = row.groups()
        source = (DOCS / "demos" / script).read_text(encoding="utf-8")
        title = source.splitlines()[1].removeprefix("# # ")
        name, folder = script.removeprefix("demo_").removesuffix(".py"), DOCS / "demos" / "output"
        saved = [*folder.glob(f"{name}*.png")] or [*folder.glob(f"{name.split('_')[-1]}*.png")]
        saved.sort(key=lambda path: ("shapes" not in path.name, path.name))
        picture = [f":img-top: {path.relative_to(DOCS)}" for path in saved[:1]]
        head = f":::{{grid-item-card}} {title}"
        target = [f":link: demos/{script.removesuffix('.py')}", ":link-type: doc"]
        return "\n".join([head, *target, *picture, "", topic, ":::", ""])

    cards = map(card, re.finditer(r"\| `(demo_\w+\.py)` \| (.*) \|", text))
    return "\n".join(["::::{grid} 1 2 3 3", ":gutter: 3", "", *cards, "::::", ""])


# -- pages ----------------------------------------------------------------------------------------

OUTSIDE = re.compile(r"\]\(\.\./(?!demos/)([^)#]*)[^)]*\)")
"""Link of a page to what is in the repository but not on the site."""


def rewrite(app, docname, source):
    """Make a page of a repository one of the site."""
    text = source[0]
    if docname == "gallery":
        text += gallery()
    if (below := {"gallery": "demos/demo_*", "reference": "api/*"}.get(docname)) is not None:
        text += "\n".join(["", "```{toctree}", ":hidden:", ":glob:", "", below, "```", ""])
    text = (
        text.replace("](../demos)", "](gallery.md)")
        .replace("](../demos/", "](demos/")
        .replace("](demos/README.md)", "](gallery.md)")
    )
    if ADDRESS:
        text = text.replace("git clone ADDRESS", f"git clone {ADDRESS[1]}")
    text = re.sub(r"\[(\w+\.md)\]\(\1\)", r"[](\1)", text)  # the title in the place of the file
    source[0] = OUTSIDE.sub(r"] (`\1`)", text)


# -- reference ------------------------------------------------------------------------------------


NAMES = {
    name: module
    for module in (ub, ub.extend, ub.distributions, st)
    for name in [*module.__all__, *getattr(module, "RESULTS", [])]
    if module is not ub or name not in ("extend", "distributions")
}
"""Modules of the public names, and of classes of results."""

PREFIX = r"(?:ub\.extend|ub\.distributions|ub|st)"


def pages_of_names(app):
    """Write a page for each public name, and note where names are used."""
    folder = DOCS / "api"
    folder.mkdir(exist_ok=True)
    for old in folder.glob("*.rst"):
        if old.stem not in NAMES:
            old.unlink()
    for name, owner in NAMES.items():
        thing = getattr(owner, name)
        kind = "class" if isinstance(thing, type) else "function" if callable(thing) else "data"
        if kind == "class" and issubclass(thing, BaseException):
            kind = "exception"
        kind = "module" if type(thing) is type(os) else kind
        module = owner.__name__ if kind != "module" else thing.__name__.rpartition(".")[0]
        lines = [name, "=" * len(name), "", f".. currentmodule:: {module}", ""]
        lines += [f".. auto{kind}:: {name if kind != 'module' else thing.__name__}"]
        lines += ["   :members:"] * (kind in ("class", "exception", "module"))
        text, page = "\n".join([*lines, ""]), folder / f"{name}.rst"
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")
    for page in sorted([*DOCS.glob("*.md"), *(DOCS / "demos").glob("*.py")]):
        words = set(re.findall(rf"\b{PREFIX}\.(\w+)", page.read_text(encoding="utf-8")))
        for name in words & NAMES.keys():
            used[name].append(page)


used = defaultdict(list)
"""Pages and demos by the public names they use."""


def where_used(app, what, name, obj, options, lines):
    """Append links to the pages and demos that use a name."""
    pages = used.get(name.rpartition(".")[2] if what != "method" else "", [])
    if pages:
        references = (f":doc:`/{page.relative_to(DOCS).with_suffix('')}`" for page in pages)
        lines += ["", ".. rubric:: Used in", "", ", ".join(references), ""]


def hide_colons(app, what, name, obj, options, lines):
    """Keep napoleon from taking what precedes a colon in a property for its type."""
    if what in ("attribute", "property") and lines:
        lines[0] = lines[0].replace(":", "\ue000")


def show_colons(app, what, name, obj, options, lines):
    """Undo it after napoleon."""
    lines[:] = [line.replace("\ue000", ":") for line in lines]


def parsable(app, what, name, obj, options, signature, returns):
    """Write a signature as the source has it, without checks of types and addresses of defaults."""
    if signature:
        signature = signature.replace("<factory>", "...")
        signature = re.sub(
            r"<function ([\w.]+)(?:\.<locals>[^>]*)?(?: at 0x[0-9a-f]+)?>", r"\1", signature
        )
        signature = without_checks(signature)
    return signature, returns


def without_checks(signature):
    """Replace each ``Annotated[type, check]`` in a signature by its type."""
    while match := re.search(r"(~?typing\.)?Annotated\[", signature):
        commas, depth, end = [], 1, match.end()
        while depth:
            depth += {"[": 1, "(": 1, "]": -1, ")": -1}.get(signature[end], 0)
            if signature[end] == "," and depth == 1:
                commas.append(end)
            end += 1
        kind = signature[match.end() : commas[0]]
        signature = signature[: match.start()] + kind + signature[end:]
    return signature


class CrossReferences(SphinxTransform):
    """Public names in inline code lead to their pages in the reference."""

    default_priority = 1  # before references are resolved

    def apply(self, **kwargs):
        """Wrap literals such as ``Beam`` and ``ub.simulate(...)``."""
        for literal in list(self.document.findall(nodes.literal)):
            match = re.match(rf"(?:{PREFIX}\.)?(\w+)(?:$|\()", literal.astext())
            inside = (nodes.reference, pending_xref, nodes.title)
            if not match or match[1] not in NAMES or isinstance(literal.parent, inside):
                continue
            options = {"refdomain": "py", "reftype": "obj", "refexplicit": True}
            name = f"{NAMES[match[1]].__name__}.{match[1]}"
            target = pending_xref("", reftarget=name, refwarn=False, **options)
            target["refdoc"] = self.env.docname
            literal.replace_self(target)
            target += literal


# -- formulas, which browsers set without scripts -------------------------------------------------


def formula(display):
    """Visitor of a formula, by MathML."""

    def visit(self, node):
        mathml = latex2mathml.converter.convert(node.astext(), display=display)
        # Few fonts have italic Greek letters.
        mathml = re.sub(
            r"<mi>(&#x003[9A-C][0-9A-F];)</mi>", r'<mi mathvariant="normal">\1</mi>', mathml
        )
        self.body.append(f'<div class="formula">{mathml}</div>' if display == "block" else mathml)
        raise nodes.SkipNode

    return visit, None


def setup(app):
    """Register the hooks."""
    app.connect("builder-inited", pages_of_names)
    app.connect("source-read", rewrite)
    app.connect("autodoc-process-docstring", hide_colons, priority=400)  # napoleon has 500
    app.connect("autodoc-process-docstring", show_colons, priority=600)
    app.connect("autodoc-process-docstring", where_used, priority=700)
    app.connect("autodoc-process-signature", parsable)
    app.add_transform(CrossReferences)
    for node, display in ((nodes.math, "inline"), (nodes.math_block, "block")):
        app.add_node(node, override=True, html=formula(display))
