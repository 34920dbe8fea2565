"""The pages for developers: each file that they name exists, and each room is named."""

import re
from pathlib import Path

import pytest

from tests.test_imports import RANKS, ROOT

DOCS = ROOT.parent / 'docs'
PAGES = 'architecture.md', 'add-a-thing.md', 'add-an-effect.md'
PATH = re.compile(r'`((?:pvibr|tests|docs|benchmarks)/[\w./-]+)`')
#: What the tutorial makes.
NEW = {'pvibr/effects/scanlines.py', 'pvibr/effects/scanlines.glsl'}


@pytest.mark.parametrize('page', PAGES)
def test_files_that_are_named_exist(page):
    named = set(PATH.findall((DOCS / page).read_text(encoding='utf-8'))) - NEW
    missing = [name for name in sorted(named) if not (ROOT.parent / name).exists()]
    assert not missing
    assert page != 'architecture.md' or len(named) > 40


def test_each_room_has_a_line():
    text = (DOCS / 'architecture.md').read_text(encoding='utf-8')
    rooms = {room.partition('.')[0] for room in RANKS}
    folders = {room for room in rooms if (ROOT / room).is_dir()}
    assert not [room for room in sorted(folders) if f'`pvibr/{room}`' not in text]


def test_each_section_of_a_shader_that_is_named_exists():
    text = (DOCS / 'architecture.md').read_text(encoding='utf-8')
    for name, section in re.findall(r'`(pvibr/[\w/]+\.glsl)`, section `(\w+)`', text):
        assert section in (ROOT.parent / Path(name)).read_text(encoding='utf-8')
