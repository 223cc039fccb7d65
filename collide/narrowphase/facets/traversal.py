"""The traversal of eight-wide box-trees shared by all questions about facets.

A stack holds pairs of references: to a box of A and to a box of B (`mesh/bvh.py`), packed into a word. The pair on top
is taken off. Where both boxes hold leaves, their facets are visited. Otherwise a node of the pair is opened, and the
children (of eight) not culled by a probe of the other box go onto the stack. A question about a single tree (a ray, a
segment) has pairs with a leaf in the place of B.

A question does each of these steps in kernels of its own, its visitors; `make_traversal` compiles them into one loop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from collide.kernels import kernel
from collide.mesh.bvh import WIDTH, box_size, link_of

#: A reference to a box fits into as many bits as this mask has.
_LOW = 0xFFFFFFFF
#: From the word of a node's child to that of the next: children of A's node, of B's.
OF_A, OF_B = 1 << 32, 1


class BoxPair(NamedTuple):
    """A box of A and one of B: references, and the links behind them, ≥ 0 a node and < 0 a leaf."""

    a: int
    b: int
    link_a: int
    link_b: int


def make_traversal(next_pair: Callable, pair_behind: Callable, visit_leaves: Callable, open_pair: Callable) -> Callable:
    """A kernel ``traverse(query, stack, top)`` over the ``top`` words on a stack, made of four others.

    query : a record of the caller's, handed to all of them.
    next_pair(query, stack, top) : the stack's height, its word on top being the next to take; 0 or less ends the
        traversal.
    pair_behind(query, word) : the `BoxPair` of a word.
    visit_leaves(query, pair) : looks at the facets of two leaves; True ends the traversal.
    open_pair(query, pair, stack, top) : pushes children of one of the nodes; the stack's new height.

    The kernel returns what ``next_pair`` gave in the end, 0 where a visit ended it.
    """

    @kernel(inline=True)
    def traverse(query, stack, top):
        while True:
            top = next_pair(query, stack, top)
            if top <= 0:
                return top
            top -= 1
            pair = pair_behind(query, stack[top])
            if pair.link_a < 0 and pair.link_b < 0:
                if visit_leaves(query, pair):
                    return 0
            else:
                top = open_pair(query, pair, stack, top)

    return traverse


@kernel(inline=True)
def any_pair(_query, _stack, top):
    """`next_pair` of a traversal that goes depth first to its end."""
    return top


@kernel(inline=True)
def pair_of_trees(query, word):
    """`pair_behind` of two trees."""
    a = word >> 32
    b = word & _LOW
    return BoxPair(a, b, link_of(query.trees.A.links, a), link_of(query.trees.B.links, b))


@kernel(inline=True)
def box_of_tree(query, word):
    """`pair_behind` of one tree: words are references."""
    return BoxPair(word, 0, link_of(query.segment.tree.links, word), -1)


@kernel(inline=True)
def opens_b(A, B, pair, units):
    """Whether B's node of a pair is opened rather than A's: the larger box, or the only box that is no leaf.

    units : unit of A's boxes over the unit of B's.
    """
    return pair.link_a < 0 or (pair.link_b >= 0 and box_size(B.boxes, pair.b) > units * box_size(A.boxes, pair.a))


@kernel(inline=True)
def push_children(stack, top, mask, word, step):
    """Put the children of a mask of eight onto the stack, in ascending order; returns its height.

    word : that of the first child.   step : from each word to the next, OF_A or OF_B.
    """
    for slot in range(WIDTH):
        if (mask >> slot) & 1:
            stack[top] = word + slot * step
            top += 1
    return top


@kernel(inline=True)
def word_of(a, b):
    return (a << 32) | b
