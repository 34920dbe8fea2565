"""What docs/regression.md tells others to write works as it stands there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

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

    made = run('--add_missing_images')
    assert made.returncode == 0, made.stdout
    assert (tmp_path / 'image_cache_dir' / 'bloom.png').is_file()
    assert run().returncode == 0
    test = tmp_path / 'test_pictures.py'
    test.write_text(test.read_text().replace('orange', 'black'))
    differs = run()
    assert differs.returncode == 1, differs.stdout
    assert 'RegressionError' in differs.stdout
