"""Which pairs of geoms MuJoCo never tests: its filters, as its documentation of collision detection lists them."""

from __future__ import annotations

import numpy as np

#: Why a pair is never tested, by the codes of `filtered`; 0: it is tested.
REASONS = (
    "", "contype and conaffinity", "parent and child", "excluded", "contacts are off", "neither moves", "one body",
)
#: Reasons up to this one are filters; those after it follow from how bodies hang together.
FILTERS, _OFF, _STILL, _ONE_BODY = 4, 4, 5, 6
#: Flags that disable; with either MuJoCo tests nothing.
_OF_CONTACTS = ("constraint", "contact")


def filtered(model, geoms: np.ndarray) -> np.ndarray:
    """(n, n) uint8, why MuJoCo never tests a pair of these geoms, as `REASONS` has it; 0 where it does.

    geoms : (n,) int numbers of geoms. O(n²). Pairs that the model names are tested, whatever the filters say, but
    where `contacts_off`: then nothing is.
    """
    import mujoco

    parents_too = int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    body = np.asarray(model.geom_bodyid)[geoms]
    weld = np.asarray(model.body_weldid)[body]
    out = np.zeros((len(geoms), len(geoms)), dtype=np.uint8)
    contype, conaffinity = model.geom_contype[geoms], model.geom_conaffinity[geoms]
    takes = (contype[:, None] & conaffinity[None, :]) != 0
    out[~(takes | takes.T)] = 1
    if not int(model.opt.disableflags) & parents_too:
        parent = model.body_weldid[model.body_parentid[weld]]
        is_child = (parent[:, None] == weld[None, :]) & (weld[:, None] != 0) & (weld[None, :] != 0)
        out[is_child | is_child.T] = 2
    of_body: dict[int, list[int]] = {}
    for k, number in enumerate(body.tolist()):
        of_body.setdefault(number, []).append(k)
    for signature in np.asarray(model.exclude_signature).tolist():
        first, second = of_body.get(signature >> 16, ()), of_body.get(signature & 0xFFFF, ())
        if first and second:
            out[np.ix_(first, second)] = 3
            out[np.ix_(second, first)] = 3
    still = ~moves(model)[body]
    out[still[:, None] & still[None, :]] = _STILL
    out[weld[:, None] == weld[None, :]] = _ONE_BODY
    for a, b in named_pairs(model, geoms):
        out[a, b] = out[b, a] = 0
    if contacts_off(model):
        out[out <= FILTERS] = _OFF
    np.fill_diagonal(out, _ONE_BODY)
    return out


def contacts_off(model) -> tuple[str, ...]:
    """The flags of a model's option that turn all its contacts off, as MJCF names them."""
    import mujoco

    set_ = int(model.opt.disableflags)
    return tuple(name for name in _OF_CONTACTS if set_ & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}")))


def groups_of(model, geoms: np.ndarray) -> np.ndarray:
    """(n,) int, a group for each of these geoms: geoms of one body that MuJoCo tests against the same geoms of others.

    Groups are numbered in the order of their first geoms. O(n + k²) for k different sorts of geoms.
    """
    named = np.zeros(len(geoms), dtype=np.int64)
    for pair in named_pairs(model, geoms):
        named[list(pair)] = 1 + np.array(pair)  # geoms that are named are sorts of their own
    body = np.asarray(model.geom_bodyid)[geoms]
    about = np.stack([body, model.geom_contype[geoms], model.geom_conaffinity[geoms], named], axis=1)
    _, first, sort_of = np.unique(about, axis=0, return_index=True, return_inverse=True)
    tested = filtered(model, np.asarray(geoms)[first]) == 0
    tested &= body[first][:, None] != body[first][None, :]
    numbers: dict[tuple[int, bytes], int] = {}
    rows = [(int(number), np.packbits(row).tobytes()) for number, row in zip(body[first], tested)]
    return np.array([numbers.setdefault(rows[k], len(numbers)) for k in sort_of.ravel().tolist()], dtype=np.int64)


def named_pairs(model, geoms: np.ndarray) -> list[tuple[int, int]]:
    """Positions among these geoms of the pairs that the model names."""
    place = {geom: k for k, geom in enumerate(np.asarray(geoms).tolist())}
    pairs = zip(np.asarray(model.pair_geom1).tolist(), np.asarray(model.pair_geom2).tolist())
    return [(place[a], place[b]) for a, b in pairs if a in place and b in place]


def moves(model) -> np.ndarray:
    """(n_bodies,) bool: which bodies a joint moves; those that do not, mocap bodies too, are never tested together."""
    out = np.zeros(model.nbody, dtype=bool)
    for body in range(1, model.nbody):
        out[body] = out[model.body_parentid[body]] or model.body_jntnum[body] > 0
    return out
