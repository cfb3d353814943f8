"""Sphinx configuration: ``pip install '.[docs]' && sphinx-build docs docs/_build``."""

project = "indicial"
extensions = ["myst_parser"]
myst_enable_extensions = ["dollarmath"]
html_theme = "alabaster"
exclude_patterns = ["_build"]
