"""What the headers of LAS and LAZ files promise, against their bytes.

The reader takes memory and time for all that is declared, and its parallel part ends the process
where there is no memory (laz-rs 0.7). The layouts are those of LAS 1.4 R15 and of LASzip.
"""

from __future__ import annotations

import struct

#: Points of a chunk: LASzip's own has 50 000.
_MOST_CHUNK_POINTS = 2**20
#: Of the record: chunk size and number of items after 12 bytes and 16 more; an item's type, size.
_CHUNK_SIZE, _ITEM_COUNT, _ITEM = struct.Struct('<I'), struct.Struct('<H'), struct.Struct('<HHH')
#: Place of the table of chunks, before the points; version and number of chunks, in the table.
_PLACE, _TABLE = struct.Struct('<q'), struct.Struct('<II')
#: How much smaller points may be that are packed: real ones are by 5 to 20.
_MOST_RATIO = 1000
#: Places of the numbers of records, of extended ones from LAS 1.4 on, and the bytes of each.
_RECORDS = ((100, 54), (243, 60))
_MINOR_VERSION_PLACE = 25


def check_las(path):
    """Raise a ValueError unless a file may hold the records that it declares."""
    with path.open('rb') as file:
        head = file.read(_RECORDS[1][0] + 4)
    has_extended = head[_MINOR_VERSION_PLACE : _MINOR_VERSION_PLACE + 1] >= b'\4'
    file_bytes = path.stat().st_size
    for place, record_bytes in _RECORDS[: 1 + has_extended]:
        count = int.from_bytes(head[place : place + 4], 'little')
        if count * record_bytes > file_bytes:
            raise ValueError(f'records must fit in its {file_bytes} bytes, got {count} records')


def check_points(path, header):
    """Raise a ValueError unless a file holds its points, packed or not."""
    most = path.stat().st_size * (_MOST_RATIO if header.are_points_compressed else 1)
    if header.point_count * header.point_format.size > most:
        raise ValueError(f'points must fit in the file, got {header.point_count} points')


def check_laz(path, header) -> bool:
    """Raise a ValueError if a file cannot hold its chunks; return whether these are small."""
    (record,) = (packing.record_data for packing in header.vlrs.get('LasZipVlr'))
    (chunk_points,) = _CHUNK_SIZE.unpack_from(record, 12)
    (item_count,) = _ITEM_COUNT.unpack_from(record, 32)
    items = [_ITEM.unpack_from(record, 34 + _ITEM.size * k) for k in range(item_count)]
    point_bytes = sum(size for _, size, _ in items)
    if point_bytes != header.point_format.size:
        raise ValueError(
            f'points must have {header.point_format.size} bytes, got items of {point_bytes}'
        )
    chunk_count = _chunk_count(path, header.offset_to_point_data)
    file_bytes = path.stat().st_size
    if chunk_count * point_bytes > file_bytes:
        raise ValueError(f'chunks must fit in its {file_bytes} bytes, got {chunk_count} chunks')
    if header.point_count > chunk_count * chunk_points:
        raise ValueError(
            f'it must have at most {chunk_count * chunk_points} points, got {header.point_count}'
        )
    return chunk_points <= _MOST_CHUNK_POINTS


def _chunk_count(path, points_place) -> int:
    """Return how many chunks the table of a file declares."""
    with path.open('rb') as file:
        file.seek(points_place)
        (table_place,) = _PLACE.unpack(file.read(_PLACE.size))
        if table_place <= points_place:  # written as a stream: the place is at the end
            file.seek(-_PLACE.size, 2)
            (table_place,) = _PLACE.unpack(file.read(_PLACE.size))
        file.seek(table_place)
        return _TABLE.unpack(file.read(_TABLE.size))[1]
