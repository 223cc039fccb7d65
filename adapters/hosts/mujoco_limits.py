"""How many contacts of a pair MuJoCo takes, by the kinds of its geoms: asked of a child process.

MuJoCo tells by refusing one contact too many. It leaves that call by a jump, and what the call had in hand stays as it
was; so a process that is thrown away asks, once for all that this one has to know.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import cache

import numpy as np

from collide.adapters.hosts.mujoco_layout import FIELD, KINDS, OURS, PLANE, TRIAL, N, host, instead, refused

#: Contacts of a pair where MuJoCo sets no limit of its own below that; of a height field, which has many patches.
_MAX_CONTACTS, _MAX_ON_FIELD = 8, 50
#: Seconds that the child may take: it imports MuJoCo and makes a hundred models of two geoms.
_SECONDS = 120.0


def max_contacts(flags: tuple[int, int]) -> np.ndarray:
    """(N, N) int64: contacts of a pair that MuJoCo takes under these `disableflags` and `enableflags`; 0 where not
    ours. Raises UnsupportedQuery where MuJoCo does not tell.
    """
    off, on = _bits()
    return _all_limits()[bool(flags[0] & off), bool(flags[1] & on)]


def _bits() -> tuple[int, int]:
    """The flags that these numbers depend on: of those that disable, and of those that enable; 0 for none."""
    mujoco = host().mujoco
    off, on = (getattr(bits, name, 0) for bits, name in (
        (mujoco.mjtDisableBit, "mjDSBL_MULTICCD"), (mujoco.mjtEnableBit, "mjENBL_MULTICCD"),
    ))
    return int(off), int(on)


@cache
def _all_limits() -> dict[tuple[bool, bool], np.ndarray]:
    """By whether each of the flags is set."""
    if not host().has_limits:
        counts = _counts(lambda i, j: int(host().mujoco.mjMAXCONPAIR))
        return {(off, on): counts for off in (False, True) for on in (False, True)}
    command = [sys.executable, "-c", "from collide.adapters.hosts.mujoco_limits import main; main()"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_SECONDS, check=True)
        reported = json.loads(done.stdout.splitlines()[-1])
    except (OSError, subprocess.SubprocessError, ValueError, IndexError) as error:
        last = (getattr(error, "stderr", None) or str(error)).strip().splitlines()[-1:]
        raise refused(host().mujoco, f"how many contacts pairs may have is not reported ({' '.join(last)})") from None
    return {(bool(off), bool(on)): np.array(counts, dtype=np.int64) for off, on, counts in reported}


def main() -> None:
    """The child: print all numbers as JSON."""
    off, on = _bits()
    print(json.dumps([
        [bool(disabled), bool(enabled), _counts(lambda i, j: _limit(i, j, disabled, enabled)).tolist()]  # noqa: B023
        for disabled in {0, off} for enabled in {0, on}
    ]))


def _counts(limit) -> np.ndarray:
    """(N, N): ``limit(i, j)`` of the kinds that are ours."""
    counts = np.zeros((N, N), dtype=np.int64)
    for i in OURS:
        for j in OURS:
            if i <= j and j not in (PLANE, FIELD) and host().table[N * i + j]:
                counts[i, j] = min(limit(i, j), _MAX_ON_FIELD if i == FIELD else _MAX_CONTACTS)
    return counts


def _limit(i: int, j: int, disabled: int, enabled: int) -> int:
    """What MuJoCo says it expects at most, when it is reported of one contact more than it ever takes."""
    mujoco, table = host().mujoco, host().table
    bodies = [_geom_text(i) if i in (PLANE, FIELD) else f"<body><freejoint/>{_geom_text(i)}</body>"]
    bodies.append(f"<body><freejoint/>{_geom_text(j)}</body>")
    text = TRIAL[: TRIAL.index("<worldbody>")] + f"<worldbody>{''.join(bodies)}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= disabled
    model.opt.enableflags |= enabled
    try:
        with instead(table, N * i + j, lambda *_: int(mujoco.mjMAXCONPAIR) + 1):
            mujoco.mj_forward(model, mujoco.MjData(model))
    except mujoco.FatalError as error:
        if reported := re.search(r"expected at most (\d+)", str(error)):
            return int(reported[1])
    raise refused(mujoco, f"how many contacts {KINDS[i]} and {KINDS[j]} may have is not reported")


def _geom_text(kind: int) -> str:
    name = KINDS[kind]
    of_asset = f'{name}="t"' if name in ("mesh", "hfield") else 'size=".1 .1 .1"'
    return f'<geom type="{name}" {of_asset}/>'
