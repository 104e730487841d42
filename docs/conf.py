"""Settings of the documentation; sh tools/docs builds it."""

import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_ext"))

project = "aeolid"
author = "the aeolid project"
copyright = "the aeolid project, MIT licence"
_HEADER = (HERE.parent / "include/aeolid/aeolid.h").read_text(encoding="utf-8")
release = version = ".".join(re.findall(r"#define AEO_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", _HEADER))

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton", "plain_docstrings", "c_headers", "command_line",
              "physics", "equations", "decision_rules"]  # fmt: skip
exclude_patterns = ["_ext", "_static"]
myst_enable_extensions = ["colon_fence", "attrs_inline"]
myst_heading_anchors = 3
root_doc = "index"

html_theme = "furo"
html_title = f"aeolid {release}"
html_static_path = ["_static"]
html_css_files = ["aeolid.css"]
html_copy_source = False
html_show_sourcelink = False
copybutton_prompt_text = "$ "

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"Array": "Array", "ComplexArray": "ComplexArray"}
python_maximum_signature_line_length = 90
c_maximum_signature_line_length = 100
toc_object_entries = False

# Annotations name types of libraries whose inventories would have to be fetched.
nitpick_ignore_regex = [(r"py:.*", r".*")]
# C's own types; every other name in a signature has to be documented.
nitpick_ignore = [("c:identifier", name) for name in ("size_t", "uint8_t", "uint16_t", "uint32_t", "uint64_t", "int8_t",
                                                       "int16_t", "int32_t", "int64_t")]  # fmt: skip
