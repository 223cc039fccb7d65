"""Messages of ROS as arrays, without ROS: objects with the fields of a message, or mappings of the same names.

Data are an array or a list of bytes, a buffer, or base64 text, the form of rosbridge.
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping
from typing import Any

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidShape

#: numpy's types of sensor_msgs/PointField, by their numbers.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


@np.errstate(invalid="ignore")  # signalling NaNs
def points_of_message(what: str, message: Any) -> np.ndarray:
    """(n, 3) float64, finite or not, of a sensor_msgs/PointCloud2. what : for messages.   Raises InvalidShape."""
    height, width, point_step, row_step = (
        checks.integer(f"{what}.{name}", message_field(what, message, name), 0, InvalidShape)
        for name in ("height", "width", "point_step", "row_step")
    )
    order = ">" if checks.true_or_false(f"{what}.is_bigendian", message_field(what, message, "is_bigendian")) else "<"
    data = message_bytes(f"{what}.data", message_field(what, message, "data"))
    if row_step < width * point_step or len(data) != height * row_step:
        raise InvalidShape(
            f"{what}: {height} × {width} points of {point_step} bytes, in rows of {row_step}, do not fit {len(data)} "
            "bytes of data"
        )
    kinds, offsets = _coordinates(f"{what}.fields", message_field(what, message, "fields"), point_step)
    if not height * width:
        return np.zeros((0, 3))
    layout = np.dtype(
        {"names": ["x", "y", "z"], "formats": [order + kind for kind in kinds], "offsets": offsets,
         "itemsize": point_step}
    )
    points = np.ndarray((height, width), layout, data, strides=(row_step, point_step))  # type: ignore[call-overload]
    return np.stack([points[axis].astype(np.float64).ravel() for axis in "xyz"], axis=1)


def _coordinates(what: str, fields: Any, point_step: int) -> tuple[list[str], list[int]]:
    """(types, offsets in bytes) of x, y and z."""
    by_name: dict[str, Any] = {}
    for field in checks.listed_entries(what, fields, "the fields of a PointCloud2", InvalidShape):
        name = checks.text(f"{what}: name", message_field(what, field, "name"), InvalidShape)
        if name in by_name:
            raise InvalidShape(f"{what}: two fields are named {checks.brief(name)}")
        by_name[name] = field
    if not {"x", "y", "z"} <= by_name.keys():
        raise InvalidShape(f"{what} must have x, y and z, got {checks.brief([*by_name])}")
    kinds, offsets = [], []
    for axis in "xyz":
        read = [
            checks.integer(f"{what}: {name} of {axis}", message_field(what, by_name[axis], name), 0, InvalidShape)
            for name in ("datatype", "offset", "count")
        ]
        kind, count = _TYPES.get(read[0]), read[2]
        if kind is None or count > 1:  # messages of old say 0 for 1
            raise InvalidShape(
                f"{what}: {axis} must be a number of datatype 1 to 8, got {count} of datatype {checks.brief(read[0])}"
            )
        if read[1] + np.dtype(kind).itemsize > point_step:
            raise InvalidShape(f"{what}: {axis} at byte {read[1]} is beyond a point_step of {point_step}")
        kinds.append(kind)
        offsets.append(read[1])
    return kinds, offsets


def message_field(what: str, message: Any, name: str) -> Any:
    """A field of a message. Raises InvalidShape where the message has no such field."""
    missing = object()
    value = message.get(name, missing) if isinstance(message, Mapping) else getattr(message, name, missing)
    if value is missing:
        raise InvalidShape(f"{what} must be a message with {name}, or a mapping with such a key, got "
                           f"{checks.brief(message)}")
    return value


def message_bytes(what: str, data: Any) -> np.ndarray:
    """(n,) uint8, C-contiguous. Raises InvalidShape for anything but bytes."""
    if isinstance(data, str):
        try:
            data = base64.b64decode(data, validate=True)
        except (binascii.Error, ValueError):
            raise InvalidShape(f"{what} must be bytes, or base64 text, got {checks.brief(data)}") from None
    if isinstance(data, bytes):
        return np.frombuffer(data, dtype=np.uint8)
    read = checks.plain_array(what, data, "(n,) bytes", InvalidShape)
    if read.ndim == 1 and not read.size:
        return np.zeros(0, dtype=np.uint8)
    if read.ndim != 1 or read.dtype.kind not in "iu" or read.min() < -128 or read.max() > 255:
        raise InvalidShape(f"{what} must be bytes (n,), got {checks.brief(data)}")
    return np.ascontiguousarray(read.astype(np.uint8))
