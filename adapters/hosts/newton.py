"""Newton with collide's contacts: a collision pipeline whose contacts any of its rigid-body solvers takes.

    from collide.adapters.hosts.newton import Pipeline
    pipeline = Pipeline(model)                  # in place of newton.CollisionPipeline(model)
    contacts = pipeline.contacts()
    ...
    pipeline.collide(state, contacts)
    solver.step(state, state_after, control, contacts, dt)

Contacts are written into ``newton.Contacts`` by its documented fields, on the CPU, where its arrays and numpy's are the
same memory. docs/hosts.md says what is covered.
"""

from __future__ import annotations

import importlib
import warnings
from typing import Any

import numpy as np

from collide import World
from collide.adapters.hosts.quaternion_poses import poses_of
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, InvalidPose, MissingExtra, UnsupportedQuery, brief
from collide.shapes import (
    Box,
    Capsule,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HeightField,
    Mesh,
    Shape,
    Sphere,
)

#: Arrays of a model that are read, and of its contacts that are written.
_MODEL_FIELDS = (
    "shape_type", "shape_scale", "shape_transform", "shape_body", "shape_flags", "shape_margin", "shape_gap",
    "shape_source", "shape_contact_pairs",
)
_CONTACT_FIELDS = tuple(
    f"rigid_contact_{name}"
    for name in (
        "count", "shape0", "shape1", "point0", "point1", "offset0", "offset1", "normal", "margin0", "margin1", "tids",
    )
)
#: Arguments of ``newton.CollisionPipeline`` about how it searches, which change no answer here.
_OF_ITS_SEARCH = (
    "broad_phase", "reduce_contacts", "max_triangle_pairs", "shape_pairs_max", "deterministic", "verify_buffers",
    "contact_reduction_hashtable_size_factor", "publish_capacity", "contact_matching_pos_threshold",
    "contact_matching_normal_dot_threshold",
)
#: Those about particles, which Newton's own pipeline answers.
_OF_PARTICLES = (
    "soft_contact_max", "soft_contact_gap", "soft_contact_margin", "enable_rigid_soft_full_surface_contact",
)
#: Those that ask for what is not done here, but for these values.
_REFUSED_BUT = {
    "body_pair_reduction": (None,), "narrow_phase": (None,), "sdf_hydroelastic_config": (None,),
    "contact_report": (False,), "contact_matching": ("disabled",), "speculative_contact_gap_max": (None,),
    "dynamic_shape_scale": (False,), "include_static_kinematic_pairs": (True,), "requires_grad": (None, False),
}


class Pipeline:
    """Contacts of a Newton model's shapes by `World.contacts`, with the methods of ``newton.CollisionPipeline``.

    Parameters
    ----------
    model : ``newton.Model`` on the CPU.
    rigid_contact_max : how many contacts there is room for; None for 8 a pair of shapes, at least 256, at most 65,536.
    max_contacts : of each patch, ≥ 1.
    shape_pairs_filtered : pairs in place of ``model.shape_contact_pairs``.
    options : further arguments of ``newton.CollisionPipeline``. Those about its search (``broad_phase`` and the like)
        have no effect. Of a model with particles those about soft contacts go to Newton's own pipeline, which makes
        them; others have no particles to be about. What is not done here is refused by name.

    Attributes
    ----------
    world : the `World`; bodies are named as Newton labels its shapes, with their numbers.
    remaining : {shape: why} for shapes that are left out; a RuntimeWarning says so.

    Raises
    ------
    InvalidArgument : no model.   InvalidShape : a shape whose numbers make none.
    MissingExtra : newton is not installed.
    UnsupportedQuery : a model on another device than the CPU, a Newton whose fields are others, or an option that asks
        for what is not done here.   TypeError : an argument that Newton has not, either.

    Notes
    -----
    Pairs are those of ``model.shape_contact_pairs``. Changing kinds, sizes or pairs of shapes needs another Pipeline.
    """

    def __init__(
        self, model: Any, *, rigid_contact_max: int | None = None, max_contacts: int = 8,
        shape_pairs_filtered: Any = None, **options: Any,
    ):
        newton = _newton()
        if not isinstance(model, newton.Model):
            raise InvalidArgument(f"Pipeline: model must be a newton.Model, got {type(model).__name__}")
        _check_fields(newton, model, _MODEL_FIELDS)
        _check_device(model)
        _check_options(options)
        if rigid_contact_max is not None:
            rigid_contact_max = checks.integer("Pipeline: rigid_contact_max", rigid_contact_max, 0)
        max_contacts = checks.integer("Pipeline: max_contacts", max_contacts, 1)
        self._newton, self._model, self._max_contacts = newton, model, max_contacts
        self.remaining: dict[int, str] = {}
        shapes = [self._shape(k) for k in range(model.shape_count)]
        self._shapes = np.array([k for k, shape in enumerate(shapes) if shape is not None], dtype=np.int64)
        self._bodies = model.shape_body.numpy()[self._shapes].astype(np.int64)
        self._X_BS = poses_of(model.shape_transform.numpy()[self._shapes].astype(np.float64))
        self._margins = model.shape_margin.numpy()[self._shapes].astype(np.float64)
        self._gaps = model.shape_gap.numpy()[self._shapes].astype(np.float64)
        self.world = World()
        for k, body in zip(self._shapes.tolist(), self._bodies.tolist()):
            label = f"{model.shape_label[k]} {k}" if getattr(model, "shape_label", None) else f"shape {k}"
            self.world.add(shapes[k], np.eye(4), name=label, static=body < 0)
        listed = model.shape_contact_pairs if shape_pairs_filtered is None else shape_pairs_filtered
        pairs = np.empty((0, 2), int) if listed is None else _pairs(listed)
        self._allow_others(pairs)
        wanted = min(max(256, 8 * len(pairs)), 65_536)
        self.rigid_contact_max = wanted if rigid_contact_max is None else rigid_contact_max
        self._soft = self._soft_pipeline({name: options[name] for name in _OF_PARTICLES if name in options})

    def _soft_pipeline(self, options: dict[str, Any]) -> Any:
        """Newton's own, of no pair of shapes: it finds the contacts of particles. None without particles."""
        if not self._model.particle_count:
            return None
        no_pairs = importlib.import_module("warp").empty(
            0, dtype=self._model.shape_contact_pairs.dtype, device=self._model.device
        )
        return self._newton.CollisionPipeline(
            self._model, broad_phase="explicit", shape_pairs_filtered=no_pairs,
            rigid_contact_max=self.rigid_contact_max, **options,
        )

    def contacts(self) -> Any:
        """A new ``newton.Contacts`` with room for this model's."""
        if self._soft is not None:
            contacts = self._soft.contacts()
        else:
            contacts = self._newton.Contacts(self.rigid_contact_max, 0, device=self._model.device)
        _check_fields(self._newton, contacts, _CONTACT_FIELDS)
        return contacts

    def collide(self, state: Any, contacts: Any, **of_particles: Any) -> None:
        """Write the contacts of the bodies as they stand in a state.

        Parameters
        ----------
        state : of the model.
        contacts : ``newton.Contacts``, of `contacts` or of Newton's own pipeline; cleared first.
        of_particles : further arguments of ``newton.CollisionPipeline.collide``, which are about particles and what
            moves between steps; without particles they have no effect.

        Raises
        ------
        InvalidPose : a body whose pose is no number.
        UnsupportedQuery : more contacts than there is room for; nothing is written.

        Notes
        -----
        Contacts count up to the sum of the two shapes' gaps beyond their margins. Points lie on the surfaces, normals
        point from shape 0 to shape 1; numbers are rounded to single precision, as Newton keeps them.
        """
        X_WB, X_WS = self._poses(state)
        self.world.set_poses(np.arange(len(self._shapes)), X_WS)
        reach = 2.0 * float((self._margins + self._gaps).max(initial=0.0))
        rows = self.world.contacts(reach, max_contacts=self._max_contacts).rows
        a, b = rows["a"], rows["b"]
        thickness = self._margins[a] + self._margins[b]
        rows = rows[rows["distance"] - thickness <= self._gaps[a] + self._gaps[b]]
        capacity = len(contacts.rigid_contact_shape0)
        if len(rows) > capacity:
            raise UnsupportedQuery(
                f"Pipeline.collide: {len(rows)} contacts, but there is room for {capacity}; "
                "make the Pipeline with rigid_contact_max"
            )
        if self._soft is not None:
            self._soft.collide(state, contacts, **of_particles)  # which clears them
        else:
            contacts.clear()
        self._write(contacts, rows, X_WB)

    # --- how it is done -------------------------------------------------------------------------

    def _poses(self, state: Any) -> tuple[np.ndarray, np.ndarray]:
        """(n, 4, 4) poses of the bodies of all shapes, and of the shapes."""
        X_WB = np.tile(np.eye(4), (len(self._shapes), 1, 1))
        moving = self._bodies >= 0
        if moving.any():
            coordinates = state.body_q.numpy()[self._bodies[moving]].astype(np.float64)
            bad = ~np.isfinite(coordinates).all(axis=1)
            if bad.any():
                body = int(self._bodies[moving][bad][0])
                raise InvalidPose(f"body {body}: its pose is not finite; the simulation has diverged")
            X_WB[moving] = poses_of(coordinates)
        return X_WB, X_WB @ self._X_BS

    def _write(self, contacts: Any, rows: np.ndarray, X_WB: np.ndarray) -> None:
        n = len(rows)
        a, b, normal = rows["a"], rows["b"], rows["normal"]
        columns: dict[str, Any] = {"shape0": self._shapes[a], "shape1": self._shapes[b], "normal": normal, "tids": 0}
        for side, body, sign in (("0", a, 1.0), ("1", b, -1.0)):
            R_BW = X_WB[body, :3, :3].swapaxes(1, 2)
            point = rows["point_a" if side == "0" else "point_b"] - X_WB[body, :3, 3]
            columns["point" + side] = np.einsum("nij,nj->ni", R_BW, point)
            columns["margin" + side] = self._margins[body]
            shift = sign * self._margins[body][:, None] * normal
            columns["offset" + side] = np.einsum("nij,nj->ni", R_BW, shift)
        for name, values in columns.items():
            getattr(contacts, f"rigid_contact_{name}").numpy()[:n] = values
        contacts.rigid_contact_count.numpy()[0] = n

    def _allow_others(self, pairs: np.ndarray) -> None:
        """Pairs that the model does not test are never tested."""
        row_of = {k: row for row, k in enumerate(self._shapes.tolist())}
        never = np.ones((len(row_of), len(row_of)), dtype=bool)
        np.fill_diagonal(never, False)
        never[np.ix_(self._bodies < 0, self._bodies < 0)] = False  # static shapes are not tested anyway
        for i, j in pairs.tolist():
            if i in row_of and j in row_of:
                never[row_of[i], row_of[j]] = never[row_of[j], row_of[i]] = False
        if len(row_of):
            self.world.allow(never, reason="not among Newton's pairs")

    def _shape(self, k: int) -> Shape | None:
        """The shape of a number; None where it does not collide, or is left out."""
        model, kinds = self._model, self._newton.GeoType
        if not int(model.shape_flags.numpy()[k]) & int(self._newton.ShapeFlags.COLLIDE_SHAPES):
            return None
        kind, scale = kinds(int(model.shape_type.numpy()[k])), model.shape_scale.numpy()[k].astype(np.float64)
        if kind == kinds.PLANE:
            x, y, _ = scale
            corners = [(x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0), (x, -y, 0.0)]
            return ConvexHull(corners) if x or y else Halfspace((0, 0, 1), 0.0)
        if kind == kinds.SPHERE:
            return Sphere(scale[0])
        if kind == kinds.BOX:
            return Box(2.0 * scale)
        if kind == kinds.ELLIPSOID:
            return Ellipsoid(scale)
        for name, made in (("CAPSULE", Capsule), ("CYLINDER", Cylinder), ("CONE", Cone)):
            if kind == kinds[name]:
                return made(scale[0], 2.0 * scale[1])
        source = model.shape_source[k]
        if kind in (kinds.MESH, kinds.CONVEX_MESH) and source is not None:
            points = np.asarray(source.vertices, dtype=np.float64) * scale
            return ConvexHull(points) if kind == kinds.CONVEX_MESH else Mesh(points, _facets(source, scale))
        if kind == kinds.HFIELD and source is not None and (scale > 0.0).all():
            return _height_field(source, scale)
        self.remaining[k] = f"shapes of kind {kind.name}"
        warnings.warn(
            f"shape {k} is left out: {self.remaining[k]} are not taken over", RuntimeWarning, stacklevel=4
        )
        return None


def _facets(source: Any, scale: np.ndarray) -> np.ndarray:
    """(m, 3) of a mesh, turned over where its scale mirrors it."""
    facets = np.asarray(source.indices, dtype=np.int64).reshape(-1, 3)
    return facets[:, ::-1] if scale.prod() < 0.0 else facets


def _height_field(source: Any, scale: np.ndarray) -> HeightField:
    """A ``newton.Heightfield`` as a solid: Newton's surface, cut along the same diagonals, and what is below."""
    heights = source.min_z + np.asarray(source.data, dtype=np.float64) * (source.max_z - source.min_z)
    n_rows, n_columns = heights.shape
    cell = 2.0 * source.hx * scale[0] / (n_columns - 1), 2.0 * source.hy * scale[1] / (n_rows - 1)
    return HeightField(scale[2] * heights, cell)


def _pairs(listed: Any) -> np.ndarray:
    """(n, 2) numbers of shapes, of warp's array of pairs."""
    pairs = listed.numpy() if hasattr(listed, "numpy") else listed
    if not isinstance(pairs, np.ndarray) or pairs.dtype.kind not in "iu" or pairs.shape[1:] != (2,):
        raise InvalidArgument(
            f"Pipeline: shape_pairs_filtered must be pairs of shapes, a warp array, got {brief(listed)}"
        )
    return pairs


def _check_options(options: dict[str, Any]) -> None:
    for name, value in options.items():
        if name in _OF_ITS_SEARCH or name in _OF_PARTICLES:
            continue
        if name not in _REFUSED_BUT:
            raise TypeError(f"Pipeline: there is no argument {name!r}, nor has newton.CollisionPipeline 1.8 one")
        harmless = _REFUSED_BUT[name]
        if not any(type(value) is type(allowed) and value == allowed for allowed in harmless):
            raise UnsupportedQuery(
                f"Pipeline: {name}={brief(value)} is not done here; leave it out, or take newton.CollisionPipeline"
            )


def _newton() -> Any:
    try:
        return importlib.import_module("newton")
    except ImportError as error:
        raise MissingExtra("newton", extra="newton", purpose="hand contacts to its solvers") from error


def _check_device(model: Any) -> None:
    if not model.device.is_cpu:
        raise UnsupportedQuery(f'Pipeline: the model is on {model.device}; finalize(device="cpu") makes one on the CPU')


def _check_fields(newton: Any, owner: Any, fields: tuple[str, ...]) -> None:
    missing = [name for name in fields if not hasattr(owner, name)]
    if missing:
        raise UnsupportedQuery(
            f"Newton {newton.__version__} has no {type(owner).__name__}.{missing[0]}; this is known to work with 1.8"
        )


def check() -> str:
    """For `collide doctor`: a ball over the ground, whose contact is read back.

    Returns
    -------
    One line that says what held.

    Raises
    ------
    RuntimeError : where the contact is not the one that is known.
    MissingExtra : newton is not installed.   UnsupportedQuery : its fields are others.
    """
    newton = _newton()
    builder = newton.ModelBuilder()
    builder.add_ground_plane()
    body = builder.add_body()
    builder.add_shape_sphere(body, radius=0.5)
    model = builder.finalize(device="cpu")
    state = model.state()
    state.body_q.numpy()[0, 2] = 0.49
    pipeline = Pipeline(model)
    contacts = pipeline.contacts()
    pipeline.collide(state, contacts)
    n, point = int(contacts.rigid_contact_count.numpy()[0]), contacts.rigid_contact_point1.numpy()[0]
    if n != 1 or not np.allclose(point, [0.0, 0.0, -0.5], atol=1e-6):
        raise RuntimeError(f"a ball in the ground: {n} contacts, the first at {point}")
    return "a ball on the ground has the contact it should"
