"""Strips of settings: each is on a page, and its pictures differ from low to high."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parents[1] / 'docs'
STRIPS = sorted(re.findall(r'def (\w+_strip)\(', (DOCS / 'strips.py').read_text()))
CHEAP = ('feather_strip', 'layers_strip', 'lens_strip', 'shadows_strip')


@pytest.mark.parametrize('name', STRIPS)
def test_is_made_and_on_a_page(name):
    assert (DOCS / 'images' / f'{name}.jpg').exists()
    assert any(f'images/{name}.jpg' in page.read_text() for page in DOCS.glob('*.md'))


@pytest.mark.parametrize('name', CHEAP)
def test_pictures_differ(name, monkeypatch):
    monkeypatch.setattr(sys, 'path', [str(DOCS), *sys.path])
    import strips

    monkeypatch.setattr(strips, 'SIZE', (64, 48))
    monkeypatch.setattr(strips, 'SAMPLES', 1)
    made = getattr(strips, name)()[26:]  # below the captions
    parts = [made[:, 68 * k : 68 * k + 64].astype(int) for k in range(4)]
    first = [np.abs(part - parts[0]).mean() for part in parts]
    assert first[1] < first[3]
    assert first[3] > 0.5
