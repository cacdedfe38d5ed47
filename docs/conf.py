"""Sphinx configuration: Markdown pages, numpydoc reference, a gallery made by running every example."""

from __future__ import annotations

import os
import sys
import tomllib
import warnings
from pathlib import Path

_root = Path(__file__).resolve().parents[1]
os.environ.setdefault("GEARLIB_CACHE", str(_root / ".cache" / "gearlib"))

sys.path.insert(0, str(_root / "docs"))  # the extensions of this project

warnings.filterwarnings("ignore", "Unknown section Explanation")  # of sympy's functions, which gearlib hands on

project = "gearlib"
author = "gearlib developers"
copyright = author
release = version = tomllib.loads((_root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]

extensions = [
    "mathml",
    "myst_parser",
    "numpydoc",
    "parts",
    "pictures",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "joss"]
suppress_warnings = ["sphinx_gallery.space_in_filename"]  # of the folder of the checkout: no example has a blank in its name
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
toc_object_entries = False

html_theme = "furo"
html_math_renderer = "mathml"
html_static_path = ["static"]
html_css_files = ["gearlib.css"]
html_title = f"gearlib {release}"

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "write_computation_times": False,
    "plot_gallery": "True",
    "within_subsection_order": "gallery_order.ReaderOrder",
}
