"""What docs/regression.md tells others to write works as it stands there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

#: A ball that covers 5 % of the picture.
CAMERA = '    pl.camera_position = [(0, 0, 6.6), (0, 0, 0), (0, 1, 0)]'
PAGE = Path(__file__).parents[1] / 'docs' / 'regression.md'


@pytest.mark.slow
def test_the_page(tmp_path):
    pytest.importorskip('pytest_pyvista')
    blocks = re.findall(r'```python\n# (\S+)\n(.*?)```', PAGE.read_text('utf-8'), re.DOTALL)
    assert [name for name, _ in blocks] == ['conftest.py', 'test_pictures.py']
    for name, text in blocks:
        (tmp_path / name).write_text(text)

    def run(*options):
        command = [sys.executable, '-m', 'pytest', '-q', *options]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    page_test = (tmp_path / 'test_pictures.py').read_text()
    small_ball = page_test.replace('test_bloom', 'test_ball')
    small_ball = small_ball.replace("color='orange'", 'color=(255, 215, 0)')
    small_ball = small_ball.replace('    pl.ibr.add(pvibr.Bloom(threshold=0.5))', CAMERA)
    ball_test = tmp_path / 'test_ball.py'
    ball_test.write_text(small_ball)
    made = run('--add_missing_images')
    assert made.returncode == 0, made.stdout
    assert (tmp_path / 'image_cache_dir' / 'bloom.png').is_file()
    for _ in range(3):
        assert run().returncode == 0
    ball_test.write_text(small_ball.replace('215', '205'))
    slightly_differs = run()
    assert slightly_differs.returncode == 1, slightly_differs.stdout
    assert '1 failed, 1 passed' in slightly_differs.stdout
    ball_test.write_text(small_ball)
    test = tmp_path / 'test_pictures.py'
    test.write_text(test.read_text().replace('orange', 'black'))
    differs = run()
    assert differs.returncode == 1, differs.stdout
    assert 'RegressionError' in differs.stdout
