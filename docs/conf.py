"""The documentation as a site: pages, API reference, gallery. `docs/build` makes it."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))
os.environ['PYVISTA_OFF_SCREEN'] = 'true'

import pages  # noqa: E402
import reference  # noqa: E402

import pvibr  # noqa: E402

project = 'pvibr'
author = 'The pvibr developers'
release = version = pvibr.__version__
extensions = [
    'myst_parser',
    'numpydoc',
    'sphinx.ext.autodoc',
    'sphinx_gallery.gen_gallery',
]
root_doc = 'index'
exclude_patterns = ['_build', 'gallery/*.ipynb', '**/GALLERY_HEADER.rst']
html_theme = 'pydata_sphinx_theme'
html_title = 'pvibr'
html_theme_options = {
    'show_toc_level': 2,
    'navigation_with_keys': False,
    'header_links_before_dropdown': 6,
    'secondary_sidebar_items': ['page-toc'],
}
html_sidebars = {'index': [], 'techniques': []}
html_show_sourcelink = False
html_static_path = [str(pages.FOLDER)]
templates_path = []
linkcheck_timeout = 20

myst_heading_anchors = 3
autodoc_typehints = 'none'
numpydoc_show_class_members = False

#: Those that serve a page until they are stopped, or need what is no part of the extras.
NOT_RUN = 'panel', 'trame_app', 'rag_doll'
sphinx_gallery_conf = {
    'examples_dirs': '../examples',
    'gallery_dirs': 'gallery',
    'ignore_pattern': r'__init__\.py|real_data',
    'filename_pattern': rf'/(?!{"|".join(NOT_RUN)})\w+\.py$',
    'nested_sections': False,
    'plot_gallery': bool(os.environ.get('PVIBR_GALLERY')),
    'image_scrapers': ('pictures',),
    'default_thumb_file': str(DOCS / 'images' / 'demo.png'),
    'download_all_examples': False,
    'remove_config_comments': True,
    'show_memory': False,
    'write_computation_times': False,
}

#: What the bar at the top leads to; each guide is in the table of guides.
CHAPTERS = 'techniques', 'guides', 'gallery/index', 'api/index', 'benchmarks', 'how-it-works'
PAGE = re.compile(r'\]\(([\w-]+)\.md\)')
EXAMPLE = re.compile(r'`examples/(\w+)\.py`')


def toctree(names):
    """Return a hidden table of contents."""
    return '\n'.join(['', '```{toctree}', ':hidden:', '', *names, '```', ''])


def adapt(_app, name, source):
    """Turn links to files of the repository into links within the site."""
    text = source[0]
    if name == 'index':
        text += toctree(CHAPTERS)
    if name == 'guides':
        guides = dict.fromkeys(PAGE.findall(text))
        text += toctree(guide for guide in guides if guide not in CHAPTERS)
    if '/' not in name:
        text = text.replace('](../examples)', '](gallery/index.rst)')
        text = re.sub(r'\]\(\.\./examples/(\w+)\.py\)', r'](gallery/\1.rst)', text)
        text = EXAMPLE.sub(r'[\g<0>](gallery/\1.rst)', text)
    source[0] = text


def setup(app):
    """Write the reference and the pages in frames, and adapt the guides."""
    reference.build()
    pages.build()
    app.connect('source-read', adapt)
