"""Pairs of shapes made ready for single calls of `contacts`: `prepare_contacts` chooses the kernel of a pair."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from collide.base.free_threads import workspace_under_lock
from collide.contact.compound_contact_call import (
    BATCH,
    COMPOSITE,
    COMPOUND_HEADER,
    KERNEL,
    N_WANTED,
    REACH_OF_BOTH,
    WANTED_AT,
    contacts_single_compound,
)
from collide.contact.contact_blocks import LIMIT, PLACES_AT, WHICH_AT, contacts_of_pairs
from collide.contact.contact_rows import CONTACT_DTYPE, no_rows
from collide.contact.convex_contacts import ManifoldSpace, manifold_addresses
from collide.contact.convex_manifolds import PAIRS_DONE, max_corners
from collide.contact.curved_contacts import single_curved_contacts
from collide.contact.mesh_contacts import single_facet_contacts
from collide.contact.ready_contacts import CONTACT_WORDS, ready_contacts
from collide.contact.single_contact_call import SINGLE_HEADER, contacts_single
from collide.contact.support_face import ROUND
from collide.kernels import address_of, code_of
from collide.kernels.prepared import prepared_contacts
from collide.lowering.compound_layout import is_flat, layout_of
from collide.lowering.compound_table import CompoundTable
from collide.lowering.hull_faces import HullFaceTable, face_table_of
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.parts import is_single_convex
from collide.lowering.shape_table import ShapeTable
from collide.narrowphase.composite.composite import single_header
from collide.narrowphase.composite.composite_block import LIST
from collide.narrowphase.composite.composite_parts import compound_parts
from collide.narrowphase.composite.single_composite_call import BALLS_WORK, balls_beyond
from collide.narrowphase.convex_batches import lowered_numbers, prepare_parts, prepare_sets, shape_table
from collide.narrowphase.convex_kernel_calls import BlockWorkspace, space_of_single_calls
from collide.narrowphase.dispatch import OF_SETS, OF_UNIONS, Method, method_of
from collide.narrowphase.pose_batches import BLOCK
from collide.narrowphase.pose_batches import HEADER as HEADER_OF_POSES
from collide.narrowphase.prepared_pairs import Prepared, Single, keep_prepared, prepared_pair, single_calls_are_safe
from collide.shapes.shape import Shape

#: What makes pairs with a mesh ready.
_OF_MESHES = {Method.FACETS: single_facet_contacts, Method.CURVED: single_curved_contacts}
#: Pairs that have kernels of single calls, if of far poses alone.
_WITH_KERNELS = (*OF_SETS, *OF_UNIONS, *_OF_MESHES)
#: Contacts of a single call of two unions; more are left to the long way.
_MAX_ROWS = 1024


def prepare_contacts(A, B) -> bool:
    """Make two shapes ready for single calls of `contacts`. Returns whether this call has made the pair ready. Single
    calls of other pairs are batches, unless bodies are far apart."""
    if not (isinstance(A, Shape) and isinstance(B, Shape) and single_calls_are_safe()):
        return False
    pair = prepared_pair(A, B)
    if pair is not None and pair.contacts is not None:
        return pair.missing_faces is not None and pair.missing_faces.make(pair)
    how = method_of(kind_of(A), kind_of(B))
    if how not in _WITH_KERNELS:
        return False
    if pair is None:
        pair = Prepared()
        keep_prepared(A, B, pair)
    are_sets = how in OF_SETS or (how is Method.PARTS and is_single_convex(A) and is_single_convex(B))
    if are_sets and pair.header is None and pair.table is None:
        pair.header = lowered_numbers(A, B)
        if pair.header is None:
            pair.take(prepare_sets(A, B))
    if how is Method.PARTS and not are_sets and is_flat(A) and is_flat(B):
        if pair.table is None:
            pair.take(prepare_parts(A, B))
        if pair.distance is not None:  # not of too many parts for single calls
            pair.missing_faces = CompoundContacts(pair.table, compound_parts(A).reach + compound_parts(B).reach)
            pair.missing_faces.get_ready(pair)
            return True
    made = None if pair.header is None else _made_of_numbers(pair.header)
    pair.contacts, held = _made_of(A, B, how, are_sets) if made is None else made
    pair.held = pair.held, held
    return True


def _made_of(A: Shape, B: Shape, how: Method, are_sets: bool) -> tuple[Single, Any]:
    """(`Prepared.contacts`, what it uses besides)."""
    if are_sets:
        return _single_contacts(shape_table(A, B)[0])
    make = _OF_MESHES.get(how)
    made = None if make is None else make(A, B)
    return _single_far_contacts(A, B) if made is None else made


def single_contacts_of(A: Shape, B: Shape) -> Single | None:
    """`Prepared.contacts` of two bodies, made ready, which makes faces as they are missed; or ``None``."""
    prepare_contacts(A, B)
    pair = prepared_pair(A, B)
    if pair is None or pair.contacts is None:
        return None
    if pair.missing_faces is None:
        return pair.contacts
    return partial(_with_faces, pair)


def _with_faces(pair: Prepared, X_WA: np.ndarray, X_WB: np.ndarray, max_contacts: int, margin: float) -> bytes | None:
    rows = pair.contacts(X_WA, X_WB, max_contacts, margin)  # type: ignore[misc]
    if rows is None and pair.missing_faces.make(pair):
        rows = pair.contacts(X_WA, X_WB, max_contacts, margin)  # type: ignore[misc]
    return rows


class CompoundContacts:
    """What single calls of `contacts` of two unions of convex parts work on. Faces of a part are made when the part
    first comes near the other union: of a thousand parts few do."""

    def __init__(self, table: CompoundTable, reach: float):
        self._table, self._reach = table, reach
        self._faces = HullFaceTable(table.table.packed, ROUND)
        self._pairs = np.zeros((LIST, 2), dtype=np.int64), np.zeros((LIST, 16)), np.zeros((LIST, 16)), np.zeros(LIST)
        self._ends, self._places = np.zeros(LIST, dtype=np.int64), np.zeros(BLOCK, dtype=np.int64)
        self._wanted = np.zeros(2 * LIST, dtype=np.int64)

    def get_ready(self, pair: Prepared) -> None:
        """Make the pair's ``contacts``."""
        table, block, space = self._table.table, _block_of_unions(), _space_of_contacts().fit(self._faces.largest)
        self._largest, at = self._faces.largest, [address_of(of) for of in self._pairs]
        self._header = header = np.zeros(COMPOUND_HEADER, dtype=np.int64)
        header[[KERNEL, WANTED_AT]] = code_of(contacts_of_pairs), address_of(self._wanted)
        header.view(np.float64)[REACH_OF_BOTH] = self._reach
        header[COMPOSITE:BATCH], composite = single_header(self._table)
        rows, batch = np.zeros(_MAX_ROWS + max_corners(self._largest), dtype=CONTACT_DTYPE), header[BATCH:]
        batch[:HEADER_OF_POSES] = block.header_of(table)
        batch[HEADER_OF_POSES : HEADER_OF_POSES + PAIRS_DONE] = manifold_addresses(
            table, self._faces, space, block.poses.rows, block.shape_of
        )
        batch[WHICH_AT:LIMIT] = at[0], at[1], 16, at[2], 16, 0, 0, at[3], 0, len(rows), address_of(self._ends)
        batch[PLACES_AT] = address_of(self._places)
        pair.contacts, pair.held = prepared_contacts(contacts_single_compound, header, rows), (
            pair.held, self, block, composite, space.buffers,
        )

    def make(self, pair: Prepared) -> bool:
        """Make the faces missed by the last call; returns False where the call missed no faces."""
        rows = self._wanted[: self._header[N_WANTED]].tolist()
        self._header[N_WANTED] = 0
        if self._faces.make(rows).largest > self._largest:
            self.get_ready(pair)
        return bool(rows)


def _single_far_contacts(A: Shape, B: Shape) -> tuple[Single, Any]:
    """(`Prepared.contacts` of two bodies, answering 0 contacts where their balls are far apart; the arrays in use)."""
    held = layout_of(A).ball, layout_of(B).ball, np.zeros(BALLS_WORK)
    header = np.array([address_of(of) for of in held], dtype=np.int64)
    return prepared_contacts(balls_beyond, header, no_rows()), held


def _made_of_numbers(header: np.ndarray) -> tuple[Single, Any] | None:
    """`_single_contacts` of two shapes of a few numbers; ``None`` where the faces take more space than there is.

    header : the block of `lower_pair`.
    """
    space, block = _space_of_contacts(), np.empty(CONTACT_WORDS, dtype=np.int64)
    if not ready_contacts(address_of(block), address_of(header), address_of(space.header), address_of(space.memory)):
        return None
    return prepared_contacts(contacts_single, block, space.rows), (header, space.buffers)


def _single_contacts(table: ShapeTable) -> tuple[Single, Any]:
    """(`Prepared.contacts` of rows 0 and 1 of a table, what it uses besides)."""
    block, faces = space_of_single_calls(), face_table_of(table, ROUND)
    space = _space_of_contacts().fit(faces.largest)
    header = np.zeros(SINGLE_HEADER, dtype=np.int64)
    header[:HEADER_OF_POSES] = block.header_of(table)
    header[HEADER_OF_POSES : HEADER_OF_POSES + PAIRS_DONE] = manifold_addresses(
        table, faces, space, space.poses, space.shape_of
    )
    return prepared_contacts(contacts_single, header, space.rows), (block, faces, space.buffers)


@workspace_under_lock
def _space_of_contacts() -> ManifoldSpace:
    """One for all single calls, as `convex_kernel_calls.space_of_single_calls`; faces of boxes fit at once."""
    return ManifoldSpace().fit(ROUND)


@workspace_under_lock
def _block_of_unions() -> BlockWorkspace:
    """A workspace for all single calls of unions, which write rows of the table into the block."""
    return BlockWorkspace()
