import errno
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pvibr.core.errors import PvibrWarning
from pvibr.instances import cache as module
from pvibr.instances.cache import AtlasCache, key_of, pack, unpack

KEY = key_of('a key')
ARRAYS = {'a': np.arange(12.0).reshape(3, 4), 'b': np.arange(5, dtype=np.uint8)}

arrays = hnp.arrays(
    st.one_of(
        hnp.integer_dtypes(),
        hnp.floating_dtypes(),
        hnp.boolean_dtypes(),
        hnp.complex_number_dtypes(),
    ),
    hnp.array_shapes(min_dims=0, min_side=0),
)
notes = st.dictionaries(st.text(), st.integers() | st.floats(allow_nan=False) | st.text())


def joined(chunks):
    return np.frombuffer(b''.join(chunks), np.uint8)


def same(left, right):
    return (
        left.dtype == right.dtype
        and left.shape == right.shape
        and left.tobytes() == right.tobytes()
    )


@given(st.dictionaries(st.text(), arrays, max_size=4), notes)
def test_what_is_packed_comes_back_to_the_bit(given_arrays, meta):
    entry = unpack(joined(pack(given_arrays, meta)))
    assert entry.meta == meta
    assert list(entry) == list(given_arrays)
    assert all(same(entry[name], array) for name, array in given_arrays.items())


@given(st.data())
def test_every_change_of_a_byte_is_found(data):
    raw = joined(pack(ARRAYS, {'x': 1})).copy()
    raw[data.draw(st.integers(0, len(raw) - 1))] ^= data.draw(st.integers(1, 255))
    with pytest.raises(ValueError, match='it is'):
        unpack(raw)


@given(st.data())
def test_every_truncation_is_found(data):
    raw = joined(pack(ARRAYS, {}))
    with pytest.raises(ValueError, match='it is'):
        unpack(raw[: data.draw(st.integers(0, len(raw) - 1))])


def test_arrays_are_aligned():
    entry = unpack(joined(pack(ARRAYS, {'x': 'y'})))
    start = entry['a'].ctypes.data
    assert (entry['b'].ctypes.data - start) % 64 == 0


def test_views_that_are_not_contiguous_are_kept(tmp_path):
    cache = AtlasCache(tmp_path)
    every_other = np.arange(20).reshape(4, 5)[::2, ::-1].T
    assert cache.put(KEY, {'a': every_other})
    assert same(cache.get(KEY)['a'], np.ascontiguousarray(every_other))


@pytest.mark.parametrize('bad', [np.array([{}]), np.zeros(2, [('x', 'f4')])])
def test_objects_and_records_are_refused(tmp_path, bad):
    with pytest.raises(TypeError, match='bad must hold numbers'):
        AtlasCache(tmp_path).put(KEY, {'bad': bad})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('key', ['', '../../etc/passwd', 'a' * 15, 'A' * 40, 'a' * 40 + '\n', 3])
def test_a_key_cannot_leave_the_folder(tmp_path, key):
    cache = AtlasCache(tmp_path)
    for call in (cache.get, lambda key: cache.put(key, ARRAYS)):
        with pytest.raises(ValueError, match='hexadecimal digits'):
            call(key)


def test_a_missing_entry_or_folder_is_none(tmp_path):
    assert AtlasCache(tmp_path).get(KEY) is None
    absent = AtlasCache(tmp_path / 'absent')
    assert absent.get(KEY) is None
    assert absent.nbytes() == 0
    absent.clear()
    assert not absent.path.exists()


def test_a_damaged_file_is_removed_with_one_warning(tmp_path):
    cache = AtlasCache(tmp_path)
    cache.put(KEY, ARRAYS)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.warns(PvibrWarning, match='baked again') as caught:
        assert cache.get(KEY) is None
    assert len(caught) == 1
    assert cache.get(KEY) is None
    assert not file.exists()


def test_the_least_recently_used_goes_first(tmp_path):
    size = len(joined(pack({'a': np.zeros(1000)}, {})))
    cache = AtlasCache(tmp_path, cap_bytes=3 * size)
    keys = [key_of(i) for i in range(4)]
    for age, key in enumerate(keys[:3]):
        assert cache.put(key, {'a': np.zeros(1000)})
        os.utime(cache._file(key), (1000 + age, 1000 + age))
    cache.get(keys[0])
    assert cache.put(keys[3], {'a': np.zeros(1000)})
    assert [cache.get(key) is not None for key in keys] == [True, False, True, True]
    assert cache.nbytes() == 3 * size


def test_an_entry_is_replaced_without_pushing_others_out(tmp_path):
    size = len(joined(pack({'a': np.zeros(1000)}, {})))
    cache = AtlasCache(tmp_path, cap_bytes=2 * size)
    other = key_of('other')
    for key in (other, KEY, KEY):
        cache.put(key, {'a': np.zeros(1000)})
    assert cache.get(other) is not None


def test_what_exceeds_the_cap_is_not_kept(tmp_path):
    cache = AtlasCache(tmp_path, cap_bytes=1000)
    cache.put(KEY, {'a': np.zeros(10)})
    assert not cache.put(key_of('large'), {'a': np.zeros(1000)})
    assert cache.get(KEY) is not None
    with pytest.raises(ValueError, match='cap_bytes'):
        AtlasCache(tmp_path, cap_bytes=-1)


def test_clear_leaves_what_is_not_an_entry(tmp_path):
    cache = AtlasCache(tmp_path)
    cache.put(KEY, ARRAYS)
    (tmp_path / 'notes.txt').write_text('mine')
    cache.clear()
    assert [file.name for file in tmp_path.iterdir()] == ['notes.txt']


def test_a_full_disk_costs_one_warning_and_leaves_nothing(tmp_path, monkeypatch):
    def full(fd):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(module.os, 'fsync', full)
    cache = AtlasCache(tmp_path)
    with pytest.warns(PvibrWarning, match='PVIBR_CACHE') as caught:
        assert not cache.put(KEY, ARRAYS)
    assert len(caught) == 1
    assert not AtlasCache(tmp_path).put(KEY, ARRAYS)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_costs_one_warning(tmp_path):
    (tmp_path / 'file').write_text('')
    cache = AtlasCache(tmp_path / 'file' / 'cache')
    with pytest.warns(PvibrWarning, match='cannot be written') as caught:
        assert not cache.put(KEY, ARRAYS)
    assert len(caught) == 1
    assert not cache.put(KEY, ARRAYS)
    assert cache.get(KEY) is None


def test_abandoned_temporary_files_are_swept(tmp_path):
    old, new = (tmp_path / f'.{name}.atlas' for name in ('old', 'new'))
    old.write_text('')
    new.write_text('')
    os.utime(old, (1, 1))
    AtlasCache(tmp_path).put(KEY, ARRAYS)
    assert not old.exists()
    assert new.exists()


def test_the_folder_of_the_environment_wins(tmp_path, monkeypatch):
    monkeypatch.setenv('PVIBR_CACHE', str(tmp_path))
    assert AtlasCache().path == tmp_path
    monkeypatch.delenv('PVIBR_CACHE')
    assert AtlasCache().path.name == 'pvibr'


def test_processes_that_write_and_read_at_once_see_whole_entries(tmp_path):
    # Four entries in a cap of two: every put removes what another process may be reading.
    code = f"""
import warnings; warnings.simplefilter('error')
import numpy as np
from pvibr.instances.cache import AtlasCache, key_of
cache = AtlasCache({str(tmp_path)!r}, cap_bytes=200_000)
for i in range(60):
    value = i % 4
    assert cache.put(key_of(value), {{'a': np.full(10_000, value)}})
    entry = cache.get(key_of(3 - value))
    assert entry is None or (entry['a'] == 3 - value).all()
"""
    running = [subprocess.Popen([sys.executable, '-c', code]) for _ in range(2)]
    assert [process.wait(60) for process in running] == [0, 0]
    assert all(file.suffix == '.atlas' for file in tmp_path.iterdir())


@given(arrays)
def test_a_key_depends_on_type_shape_and_content(array):
    key = key_of(array, {'x': 1})
    assert key == key_of(array.copy(), {'x': 1})
    assert key != key_of(array[None], {'x': 1})
    assert key != key_of(array, {'x': 2})
    assert key != key_of([array], {'x': 1})
    assert key != key_of(array.view(array.dtype.newbyteorder()) if array.itemsize > 1 else 0)


def test_arguments_do_not_run_into_each_other():
    assert key_of('ab', 'c') != key_of('a', 'bc')
    assert key_of(1) != key_of('1')
    assert key_of(None) != key_of()


def test_a_key_of_something_else_is_refused():
    with pytest.raises(TypeError, match='arrays and of what JSON holds'):
        key_of(object())


def test_45_megabytes_are_kept(tmp_path):
    cache = AtlasCache(tmp_path)
    atlas = {'colour': np.random.default_rng(0).integers(0, 255, 45_000_000, dtype=np.uint8)}
    cache.put(KEY, atlas)
    assert same(cache.get(KEY)['colour'], atlas['colour'])
