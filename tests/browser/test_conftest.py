"""A page that says an error must not pass; nor may one be missed that speaks in a second tab."""

from __future__ import annotations

import numpy as np
import pytest

pytestmark = pytest.mark.browser


def test_a_page_is_seen(page, files, picture_of):
    (files.folder / 'a.html').write_text('<body style="margin: 0; background: rgb(10, 200, 30)">')
    page.goto(f'{files.url}/a.html')
    pixels = picture_of(page)
    assert pixels.shape == (600, 800, 3)
    assert np.array_equal(np.unique(pixels.reshape(-1, 3), axis=0), [[10, 200, 30]])


@pytest.mark.parametrize('script', ['console.error("it broke")', 'throw Error("it broke")'])
@pytest.mark.parametrize('tab', [False, True])
def test_errors_are_heard(page, files, quiet, said, script, tab):
    quiet.append('it broke')
    (files.folder / 'a.html').write_text(f'<script>{script}</script>')
    (page.context.new_page() if tab else page).goto(f'{files.url}/a.html')
    assert len(said) == 1
    assert 'it broke' in said[0]
