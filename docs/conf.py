"""The site: MyST pages under Sphinx with Furo, and what ``fieldsite`` makes of the code. ``make docs`` builds it.

Nothing is fetched: formulas are MathML, and there is no inventory of other projects' names.
"""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent / "drawings"))

from fieldsite import making

import fieldgym

making.everything()

project, author = "fieldgym", "The fieldgym developers"
copyright = author
version = release = fieldgym.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "fieldsite.mathml"]
exclude_patterns = ["_build", "made", "fieldsite", "drawings", "scaling/*.json"]
html_theme = "furo"
html_title = f"fieldgym {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_extra_path = ["made/extra"]
html_math_renderer = "mathml"
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}
html_show_sourcelink = html_copy_source = False

myst_enable_extensions = ["attrs_block", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # tests run the notebooks, see tests/test_notebooks.py

autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_type_aliases = {
    name: name for name in ("Array", "ArrayLike", "Observation", "Actions", "Rows", "Flags", "Whole")
}
napoleon_google_docstring, napoleon_numpy_docstring = True, False
napoleon_use_ivar, napoleon_use_rtype = True, False
nitpicky = True
# What annotations name: other projects' types, whose inventories would have to be fetched, and those of our own that
# are not meant for use. Pages name types by links alone, and those are checked.
nitpick_ignore_regex = [(r"py:(class|obj|exc)", r".*")]


def said(app, kind, name, thing, options, lines):
    """Docstrings are plain text with code in it: a stroke is a stroke, and no substitution."""
    lines[:] = [re.sub(r"(``.*?``)|\\?\|", lambda found: found[1] or r"\|", line) for line in lines]


def skipped(app, kind, name, thing, skip, options):
    """A tuple's fields are told by the docstring of its class."""
    return True if (getattr(thing, "__doc__", None) or "").startswith("Alias for field number") else None


def setup(app):
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", said)
    app.connect("autodoc-skip-member", skipped)
