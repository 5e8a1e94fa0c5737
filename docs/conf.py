"""Sphinx configuration of the documentation site: builds offline, warnings are errors in CI."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

project = "smoskin"
author = "the smoskin developers"
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".rst": "restructuredtext", ".md": "markdown"}
exclude_patterns = ["_build", "**/README.*", "sg_execution_times.rst", "**/sg_execution_times.rst"]
root_doc = "index"
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = "smoskin"
html_static_path = ["_static"]
print(extensions)
