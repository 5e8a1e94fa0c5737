"""Sphinx configuration of the documentation site, which builds offline and without a warning."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

project = "smoskin"
author = "the smoskin developers"
extensions = [
    "myst_parser",
    "sphinx.ext.apidoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx-mathjax-offline",
    "sphinx.ext.mathjax",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".rst": "restructuredtext", ".md": "markdown"}
exclude_patterns = [
    "_build",
    "**/GALLERY_HEADER.rst",
    "**/sg_execution_times.rst",
    "sg_execution_times.rst",
]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3

apidoc_modules = [
    {
        "path": "../src/smoskin",
        "destination": "api",
        "separate_modules": True,
        "module_first": True,
        "implicit_namespaces": False,
        "automodule_options": {"members", "show-inheritance"},
    }
]
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_class_signature = "separated"
napoleon_google_docstring = False
napoleon_use_rtype = False

sphinx_gallery_conf = {
    "examples_dirs": ["../examples", "../paper"],
    "gallery_dirs": ["recipes", "figures"],
    "filename_pattern": r"\.py",
    "ignore_pattern": r"(__init__|__main__|errata)\.py",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "show_memory": False,
    "min_reported_time": 1e9,
    "abort_on_example_error": True,
    "remove_config_comments": True,
}

suppress_warnings = ["ref.python"]  # a class is known by its home and by `smoskin`

html_theme = "furo"
html_title = "smoskin"
html_copy_source = False
html_show_sourcelink = False


def spell_out_bars(app, what, name, obj, options, lines):
    """Keep bars of absolute values, |F_p|, from being read as substitutions."""
    for k, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            lines[k] = line.replace("|", "\\|")


def setup(app):
    """Register what the pages need."""
    app.connect("autodoc-process-docstring", spell_out_bars)
