"""What is asked of the GPU: counts that no machine changes, unlike times."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Counts:
    """Work of pvibr's own on the GPU, without what VTK draws by itself."""

    #: Draws of meshes, cards and full-screen programs.
    draws: int = 0
    #: Changes of the program between draws.
    programs: int = 0
    #: Uniforms set.
    uniforms: int = 0
    #: Bytes of textures uploaded.
    uploaded_bytes: int = 0
    #: Waits for the GPU: texels read at once, and timed draws.
    waits: int = 0

    def so_far(self) -> dict[str, int]:
        """Return a copy of the counts, by name."""
        return self.__dict__.copy()

    def __str__(self) -> str:
        return (
            f'{self.draws:,} draws, {self.programs:,} changes of program, '
            f'{self.uniforms:,} uniforms, {self.uploaded_bytes:,} bytes uploaded, '
            f'{self.waits:,} waits'
        )


def difference(later, earlier) -> Counts:
    """Return what was counted between two copies."""
    return Counts(**{name: count - earlier[name] for name, count in later.items()})


#: Of all windows since the start of the process.
TOTAL = Counts()
_last_program = ''  # its address: a reference would keep it alive


def count_draw(program):
    """Count a draw with a program."""
    global _last_program
    TOTAL.draws += 1
    address = program.__this__
    if address != _last_program:
        _last_program = address
        TOTAL.programs += 1
