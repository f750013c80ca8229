"""Configuration of the guide: `python -m sphinx -W docs site` writes it to site/, which opens from disk."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "_extensions"), str(HERE.parent)]

from seastar_gym.version import __version__  # noqa: E402

project = "seastar-gym"
author = copyright = "The seastar-gym authors"
version = release = __version__

extensions = ["myst_parser", "mathml", "generated"]
exclude_patterns = ["_*", "drive"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 4

toc_object_entries_show_parents = "hide"
maximum_signature_line_length = 80  # of longer ones, every argument has a line

html_theme = "furo"
html_title = f"seastar-gym {release}"
html_static_path = ["_static"]
html_css_files = ["guide.css"]
html_js_files = ["guide.js"]
html_search_scorer = str(HERE / "_static" / "scorer.js")  # lets pages that few ask for come last
html_extra_path = ["swim.html"]
html_copy_source = False
html_show_search_summary = False  # it would fetch pages, which browsers refuse from disk
