"""Mutated glTF files, read in one process: crash, hang, memory, reads outside the folder.

``python tests/animation/gltf_fuzz.py FOLDER [--count 5000] [--state fuzz.json]`` mutates the glTF
files of a folder. Input k depends on its number alone. A run that was stopped goes on with the
next number; an input that killed the process is the one after the last in the state file.
"""

from __future__ import annotations

import argparse
import copy
import json
import random
import resource
import struct
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import pvibr

SECONDS, MEBIBYTES = 10, 1024
VALUES = (-1, 0, 1, 2, 3, 255, 2**31, 2**53, 2**64, -0.5, 1e308, 1e-320, None, True, '', 'VEC3')
MORE = ([], {}, [0], [0] * 16, '../../etc/passwd', '/etc/passwd', 'data:;base64,AAAA', 'MAT4')


def document_of(path):
    """Return the JSON and the bytes of a file."""
    data = path.read_bytes()
    if data[:4] != b'glTF':
        return json.loads(data), None
    (size,) = struct.unpack_from('<I', data, 12)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def glb(document, blob):
    """Return a GLB of a JSON and bytes."""
    text = json.dumps(document).encode()
    text += b' ' * (-len(text) % 4)
    out = struct.pack('<I4s', len(text), b'JSON') + text
    if blob is not None:
        out += struct.pack('<I4s', len(blob), b'BIN\0') + blob
    return struct.pack('<4sII', b'glTF', 2, 12 + len(out)) + out


def places(value, way=()):
    """Yield the way to everything in a JSON."""
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield (*way, key)
            yield from places(value[key], (*way, key))


def mutate(rng, document):
    """Change one thing of a JSON: another value, a copy of another thing, none, or many."""
    *way, last = rng.choice(list(places(document)) or [(0,)])
    parent = document or [0]
    for key in way:
        parent = parent[key]
    what = rng.randrange(6)
    if what == 0:
        del parent[last]
    elif what == 1:
        *other, end = rng.choice(list(places(document)))
        source = document
        for key in other:
            source = source[key]
        parent[last] = copy.deepcopy(source[end])
    elif what == 2 and isinstance(parent[last], list):
        parent[last] = parent[last] * rng.choice([2, 10, 1000, 20000])
    elif what == 3 and isinstance(parent[last], int | float):
        parent[last] = parent[last] * rng.choice([-1, 0, 2, 1000, 1e-9]) + rng.choice([0, 1, -1])
    else:
        parent[last] = copy.deepcopy(rng.choice(VALUES + MORE))


def mutant(number, files):
    """Return an input by its number."""
    rng = random.Random(number)
    path = rng.choice(files)
    document, blob = document_of(path)
    for _ in range(rng.choice([1, 1, 2, 4])):
        mutate(rng, document)
    if blob and rng.random() < 0.3:
        blob = bytearray(blob)
        for _ in range(rng.choice([1, 4, 64])):
            blob[rng.randrange(len(blob))] = rng.randrange(256)
    data = bytearray(glb(document, bytes(blob) if blob is not None else None))
    if rng.random() < 0.1:
        data[rng.randrange(len(data))] = rng.randrange(256)
    if rng.random() < 0.05:
        del data[rng.randrange(len(data)) :]
    return bytes(data)


def fault_of(data, folder):
    """Read an input and pose what it gives; return what is wrong, or None."""
    path = folder / 'mutant.glb'
    path.write_bytes(data)
    opened.clear()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.process_time()
    try:
        figure = pvibr.read_gltf(path)
        took = time.process_time() - began
        for i in range(min(len(figure.meshes), 20)):
            if not np.isfinite(figure.posed(i, figure.sample(0.3))[0]).all():
                return 'a posed point is not finite'
    except pvibr.animation.GltfError:
        took = time.process_time() - began
    except Exception as error:
        return f'{type(error).__name__}: {error}'[:300]
    if took > SECONDS:
        return f'took {took:.0f} s'
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak) >> 10
    if grown > MEBIBYTES:
        return f'took {grown} MiB'
    ours = str(folder), sys.prefix, sys.base_prefix
    outside = [name for name in opened if not name.startswith(ours)]
    return f'read {outside[0]}' if outside else None


opened: list[str] = []


def main():
    """Go through the inputs; print each fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--count', type=int, default=5000)
    parser.add_argument('--seconds', type=float, default=280)
    parser.add_argument('--state', type=Path, default=Path('fuzz.json'))
    asked = parser.parse_args()
    files = sorted(p for p in asked.folder.rglob('*.gl*') if p.stat().st_size < 300_000)
    state = {'next': 0, 'faults': {}, 'longest': 0.0}
    if asked.state.exists():
        state = json.loads(asked.state.read_text())
    sys.addaudithook(lambda event, args: opened.append(str(args[0])) if event == 'open' else None)
    warnings.simplefilter('ignore')
    end = time.monotonic() + asked.seconds
    with tempfile.TemporaryDirectory() as name:
        for path in files:  # imports and caches
            fault_of(path.read_bytes(), Path(name).resolve())
        while state['next'] < asked.count and time.monotonic() < end:
            number = state['next']
            state['next'] += 1
            asked.state.write_text(json.dumps(state))  # before it is read: it may kill
            began = time.process_time()
            fault = fault_of(mutant(number, files), Path(name).resolve())
            state['longest'] = max(state['longest'], time.process_time() - began)
            if fault:
                state['faults'][number] = fault
                sys.stdout.write(f'{number} {fault}\n')
        asked.state.write_text(json.dumps(state))
    faults, longest = len(state['faults']), state['longest']
    sys.stdout.write(f'{state["next"]} inputs, {faults} faults, at most {longest:.1f} s\n')


if __name__ == '__main__':
    main()
