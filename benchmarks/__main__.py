"""Print the names of all benches, one a line."""

from __future__ import annotations

import sys

from benchmarks import BENCHES

sys.stdout.writelines(f'{name}\n' for name in BENCHES)
