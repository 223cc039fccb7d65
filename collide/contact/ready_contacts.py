"""Contacts of two shapes of a few numbers made ready for single calls by a kernel, in a single block of memory."""

from __future__ import annotations

from collide.contact.convex_manifolds import FACES_AT, NUMBERS_AT
from collide.contact.convex_manifolds import INTS_AT as MANIFOLD_INTS_AT
from collide.contact.single_contact_call import SINGLE_HEADER
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.hull_polygons import FACE_INTS, N_DOUBLES, copy_faces, find_faces
from collide.lowering.packed_convex import BLOCK, POINTS
from collide.lowering.set_rows import ADDRESS, COUNT, INTS, KIND
from collide.narrowphase.pose_batches import HEADER, INTS_AT
from collide.narrowphase.pose_batches import NUMBERS_AT as BLOCK_NUMBERS_AT

#: Words that the faces of a set take at most: of BLOCK points, twelve triangles of three corners.
_FACE_WORDS = 3 * BLOCK + BLOCK + 12 * 5 + 13 + 4 * 36 + BLOCK + 1
_FACES_AT = SINGLE_HEADER
_BLOCKS_AT = _FACES_AT + 2 * FACE_INTS
#: Words of a block: a header of `contacts_single`, rows 0 and 1 of a `HullFaceTable`, then what these point to.
CONTACT_WORDS = _BLOCKS_AT + 2 * (_FACE_WORDS + BLOCK)


@entry("boolean(int64, int64, int64, int64)", nogil=False)
def ready_contacts(block_at, header_at, usual_at, memory_at):
    """Fill a block of CONTACT_WORDS for the pair of a block of `lower_pair`; false where faces take more space.

    header : the pair's.   usual : of SINGLE_HEADER integers, copied, but for the pair's own.   memory : three doubles a
    point, then as `faces_memory` says. All threads share the memory: the kernel keeps Python's lock.
    """
    block, usual = view_i64(block_at, CONTACT_WORDS), view_i64(usual_at, SINGLE_HEADER)
    header = view_i64(header_at, HEADER)
    for k in range(SINGLE_HEADER):
        block[k] = header[k] if k < HEADER else usual[k]
    block[HEADER + MANIFOLD_INTS_AT] = header[INTS_AT]
    block[HEADER + NUMBERS_AT] = header[BLOCK_NUMBERS_AT]
    block[HEADER + FACES_AT] = block_at + 8 * _FACES_AT
    ints = view_i64(header[INTS_AT], 2 * INTS)
    line = 8 * BLOCK
    for k in range(2):
        row_at = block_at + 8 * (_FACES_AT + FACE_INTS * k)
        faces_at = (block_at + 8 * (_BLOCKS_AT + (_FACE_WORDS + BLOCK) * k) + line - 1) & -line
        if ints[INTS * k + KIND] != POINTS:
            row = view_i64(row_at, FACE_INTS)
            for word in range(FACE_INTS):
                row[word] = 0
        elif not _put_faces(ints[INTS * k + ADDRESS], ints[INTS * k + COUNT], row_at, faces_at, memory_at):
            return False
    return True


@kernel
def _put_faces(columns_at, n, row_at, faces_at, memory_at):
    """The faces of the hull of n points, from their columns (3, BLOCK); false where these take too much space."""
    columns, points = view_f64(columns_at, 3 * BLOCK), view_f64(memory_at, 3 * BLOCK)
    for k in range(n):
        for axis in range(3):
            points[3 * k + axis] = columns[BLOCK * axis + k]
    making_at = memory_at + 8 * 3 * BLOCK
    if find_faces(memory_at, n, making_at) < 0 or view_i64(making_at, N_DOUBLES + 1)[N_DOUBLES] > _FACE_WORDS:
        return False
    copy_faces(memory_at, n, making_at, faces_at, row_at)
    return True
