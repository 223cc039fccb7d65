"""Scene: which bodies there are and where they stand, as every loader and generator describes it.

A scene is plain data: bodies, pairs never tested, notes for the person who reads the report, and
the robots with their named joint values. It knows no file format and computes no collision.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidArgument, InvalidPose, SceneError, brief, cut, listing
from collide.robots.robot import LinkShape, Robot
from collide.shapes.compound import Compound
from collide.shapes.shape import Shape
from collide.transforms import as_pose, as_poses
from collide.worlds.world import World

#: With triangles, for notebooks alone.
shape_html = lazy_module("collide.shapes.shape_html")


@dataclass
class SceneBody:
    """One body of a scene: a shape at a pose.

    Parameters
    ----------
    name : str
        Unique in its scene.
    shape : Shape
        In its own frame B.
    X_WB : (4, 4) float64
        Pose of B in the world W [m].
    static : bool
        It never moves: two static bodies are not tested against each other.
    group, mask : int
        16 bits each: a pair is tested when (group_a & mask_b) and (group_b & mask_a).
    source : str
        Where it is described, ``file: element``.
    approximation : str, optional
        What the shape leaves out of the thing described; None when nothing.
    owner : str, optional
        Name of the robot it belongs to; None for the surroundings.
    """

    name: str
    shape: Shape
    X_WB: np.ndarray
    static: bool = False
    group: int = 1
    mask: int = 0xFFFF
    source: str = ""
    approximation: str | None = None
    owner: str | None = None

    def __repr__(self) -> str:
        place = ", ".join(f"{x:.6g}" for x in np.asarray(self.X_WB)[:3, 3].tolist())
        more = "".join(
            f", {text}" for text in ("static" if self.static else "", self.owner and f"of {self.owner}") if text
        )
        return f"SceneBody({self.name!r}, {self.shape!r}, at ({place}){more})"

    def _repr_html_(self) -> str:
        return shape_html.bodies_html(repr(self), [self], 1)


@dataclass
class Placement:
    """A robot in a scene: where its root stands, its joint values, and which bodies its links carry.

    X_WR : (4, 4) pose of the root link.   q : (dof,) as `Robot.joint_names` orders it.
    set_columns : names of the columns of ``q`` that were given a value; the others are at their default.
    carried : body name -> (link, X_LB): the body moves with the link.
    """

    robot: Robot
    X_WR: np.ndarray
    q: np.ndarray
    set_columns: frozenset[str] = frozenset()
    carried: dict[str, tuple[str, np.ndarray]] = field(default_factory=dict)

    def body_poses(self) -> dict[str, np.ndarray]:
        """body name -> (4, 4) pose X_WB."""
        X_WLs = self.robot.link_poses(self.q, self.X_WR)[0]
        at = {link: X_WLs[k] for k, link in enumerate(self.robot.links)}
        return {name: self._checked(name, _product(at[link], X_LB)) for name, (link, X_LB) in self.carried.items()}

    def _checked(self, name: str, X_WB: np.ndarray) -> np.ndarray:
        """What was multiplied together along the robot; InvalidPose names robot, link and file where it is no pose."""
        try:
            return as_poses(
                X_WB, f'{self.robot.place}: the pose of "{cut(name)}", on link "{cut(self.carried[name][0])}",'
            )[0]
        except InvalidPose as error:
            raise InvalidPose(f"{error}; look at the origins of the joints above it and at their values") from None


@dataclass
class Scene:
    """Bodies and robots at poses, ready to be tested.

    Parameters
    ----------
    name : str
        Of the scene.
    bodies : list of SceneBody
        In the order of the files; `add` refuses a name that is taken.
    allowed : list of (body, body, reason)
        Pairs that are never tested.
    notes : list of str
        What the user should know: joints out of limits, links without geometry, repairs.
    sources : list of str
        The files read.
    robots : dict of str to Robot
        By name.
    states : dict
        State name → {joint: value} [rad or m].
    seconds : dict of str to float
        Stage → seconds spent: ``read`` for text, ``meshes`` for meshes.
    placements : dict of str to Placement
        Robot name → where it stands, and which bodies its links carry.
    state_notes : list of str
        Those of ``notes`` that concern joint values: `with_state` writes them anew.
    """

    name: str
    bodies: list[SceneBody] = field(default_factory=list)
    allowed: list[tuple[str, str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    sources: list[str] = field(default_factory=list)
    robots: dict[str, Robot] = field(default_factory=dict)
    states: dict[str, dict[str, float]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    placements: dict[str, Placement] = field(default_factory=dict)
    state_notes: list[str] = field(default_factory=list)
    #: body name -> its source, as far as `add` knows: so that ten thousand bodies are added in one pass
    _sources: dict[str, str] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __repr__(self) -> str:
        n_static = sum(bool(body.static) for body in self.bodies)
        robots = f", robots: {', '.join(self.robots)}" if self.robots else ""
        notes = f", {len(self.notes)} notes" if self.notes else ""
        return f"Scene({self.name!r}, {len(self.bodies)} bodies ({n_static} static){robots}{notes})"

    def _repr_html_(self) -> str:
        return shape_html.bodies_html(repr(self), self.bodies[: shape_html.MAX_DRAWN], len(self.bodies))

    @property
    def state(self) -> dict[str, float]:
        """Joint → value [rad or m]: what the poses were computed from."""
        return {
            joint: float(value)
            for placement in self.placements.values()
            for joint, value in zip(placement.robot.joint_names, placement.q)
        }

    def body(self, name: str) -> SceneBody:
        """The body of a name.

        Parameters
        ----------
        name : str
            Of the body.

        Returns
        -------
        SceneBody
            The one in ``bodies``.

        Raises
        ------
        InvalidArgument
            Where there is none; the names there are, are listed.
        """
        checks.text(f"scene {self.name}: name of a body", name)
        for body in self.bodies:
            if body.name == name:
                return body
        raise InvalidArgument(
            f"scene {self.name}: no body has the name {brief(name)}; it has {listing(b.name for b in self.bodies)}"
        )

    def world(self) -> World:
        """A `collide.World` of these bodies, in their order, with the allowed pairs entered.

        Returns
        -------
        World
            A new one at each call.
        """
        world, bodies = World(), self.bodies
        if bodies:
            X_WBs, names = [body.X_WB for body in bodies], [body.name for body in bodies]
            traits = {trait: [getattr(body, trait) for body in bodies] for trait in ("static", "group", "mask")}
            world.add_many([body.shape for body in bodies], X_WBs, names=names, **traits)
        for a, b, reason in self.allowed:
            world.allow(a, b, reason=reason)
        return world

    def with_state(self, state: str | Mapping[str, float]) -> Scene:
        """This scene with its robots at other joint values; the scene itself stays as it is.

        Parameters
        ----------
        state : str or mapping of str to float
            The name of one of ``states``, or joint → value [rad or m]. Joints without a value keep theirs.

        Returns
        -------
        Scene
            A new one; shapes and robots are shared.

        Raises
        ------
        InvalidArgument
            For an unknown state or joint; the known ones are listed.
        """
        values = self._named_state(state) if isinstance(state, str) else checks.mapping(
            f"scene {self.name}: state", state, "joint → value, or the name of a state")
        shares = self.joint_shares(values)
        placements, notes = {}, []
        for name, placement in self.placements.items():
            q, about = placement.robot.configuration(shares[name], start=placement.q)
            placements[name] = replace(placement, q=q, set_columns=placement.set_columns | shares[name].keys())
            notes += about + placement.robot.default_notes(placements[name].set_columns, q)
        moved = {name: X for placement in placements.values() for name, X in placement.body_poses().items()}
        bodies = [replace(body, X_WB=moved.get(body.name, body.X_WB)) for body in self.bodies]
        own_notes = [note for note in self.notes if note not in self.state_notes]
        return replace(
            self, bodies=bodies, placements=placements, notes=own_notes + notes, state_notes=notes,
            allowed=list(self.allowed), sources=list(self.sources), seconds=dict(self.seconds),
        )

    def _named_state(self, name: str) -> dict[str, float]:
        if name not in self.states:
            raise InvalidArgument(
                f"scene {self.name}: unknown state {brief(name)}; it has {listing(self.states) or 'none'}"
            )
        return self.states[name]

    def joint_shares(self, values: Mapping[str, float]) -> dict[str, dict[str, float]]:
        """The part of a state that concerns each robot.

        Parameters
        ----------
        values : mapping of str to float
            Joint → value [rad or m], of any of the robots.

        Returns
        -------
        dict of str to dict
            Robot → {joint: value}, every robot with an entry.

        Raises
        ------
        InvalidArgument
            For a joint that no robot has; the known ones are listed.
        """
        checks.mapping(f"scene {self.name}: values", values, "joint → value")
        shares: dict[str, dict[str, float]] = {name: {} for name in self.placements}
        owner = {
            joint: name
            for name, placement in self.placements.items()
            for joint in (*placement.robot.joint_names, *(j.name for j in placement.robot.joints))
        }
        for joint, value in values.items():
            if joint not in owner:
                known = listing(j for p in self.placements.values() for j in p.robot.joint_names)
                raise InvalidArgument(
                    f"scene {self.name}: values of its state name an unknown joint {brief(joint)}; "
                    + (f"its robots have {known}" if known else "it has no robot with joints")
                )
            shares[owner[joint]][joint] = value
        return shares

    # --- building: used by loaders and generators -------------------------------------------------

    def add(self, body: SceneBody) -> None:
        """Append a body.

        Parameters
        ----------
        body : SceneBody
            With a name that is not taken.

        Raises
        ------
        SceneError
            Where the name is taken.
        """
        checks.instance(f"scene {self.name}: body", body, SceneBody, "a SceneBody", SceneError)
        checks.instance(f"scene {self.name}: shape of a body", body.shape, Shape, "a shape", SceneError)
        checks.text(f"scene {self.name}: name of a body", body.name, SceneError)
        if len(self._sources) != len(self.bodies):  # the list was changed by hand
            self._sources = {known.name: known.source for known in self.bodies}
        if body.name in self._sources:
            raise SceneError(
                f'a body named "{cut(body.name)}" exists already, from {self._sources[body.name] or "this scene"}; '
                "rename one or give a robot a prefix",
                element=body.source or None,
            )
        self.bodies.append(body)
        self._sources[body.name] = body.source

    def place_robot(
        self,
        robot: Robot,
        X_WR: np.ndarray,
        values: Mapping[str, float] | None = None,
        *,
        name: str | None = None,
        mobile: bool = False,
        allowed: Iterable[tuple[str, str, str]] | None = None,
    ) -> Placement:
        """Add a robot: a body for each link that has collision geometry.

        Parameters
        ----------
        robot : Robot
            It stays as it is, and may be placed several times under prefixes (`Robot.renamed`).
        X_WR : (4, 4) float64
            Pose of its root link R in the world W [m].
        values : mapping of str to float, optional
            Joint → value [rad or m]; the others at 0 or the nearest limit, which is noted.
        name : str, optional
            Under which the scene knows it, by default the robot's own.
        mobile : bool
            The base moves too, so that it is tested against static bodies.
        allowed : iterable of (link, link, reason), optional
            Pairs never tested, by default those of the robot.

        Returns
        -------
        Placement
            Its configuration, and which bodies its links carry.
        """
        checks.instance(f"scene {self.name}: robot", robot, Robot, "a collide.Robot")
        label = robot.name if name is None else checks.text(f"scene {self.name}: name of a robot", name)
        label = free_name(label or robot.name, dict.fromkeys(self.robots, 1))
        mobile = checks.true_or_false(f"scene {self.name}: mobile", mobile)
        if allowed is not None:
            allowed = checks.listed_entries(f"scene {self.name}: allowed", allowed, "(link, link, reason)")
        q, notes = robot.configuration({} if values is None else values)
        placement = Placement(robot, as_pose(X_WR, "X_WR"), q, frozenset(values or ()))
        notes += robot.default_notes(placement.set_columns, q)
        links: dict[str, SceneBody] = {}
        for link in robot.links:
            if link in robot.geometry:
                body, X_LB = link_body(link, robot.geometry[link])
                body.owner, body.static = label, link in robot.base_links and not mobile
                self.add(body)
                links[body.name] = body
                placement.carried[body.name] = (link, X_LB)
        self.robots[label], self.placements[label] = robot, placement
        for body_name, X_WB in placement.body_poses().items():
            links[body_name].X_WB = X_WB
        self.allowed += robot.disabled_pairs if allowed is None else allowed
        self.sources += [source for source in robot.sources if source not in self.sources]
        self.notes += robot.notes + notes
        self.state_notes += notes
        for state, joints in robot.states.items():
            self.states.setdefault(state, {}).update(joints)
        return placement

    def carry(self, owner: str, link: str, body: SceneBody, X_LB: np.ndarray) -> None:
        """Add a body that moves with a link of a robot in the scene, such as a grasped part.

        Parameters
        ----------
        owner : str
            Name of the robot, as of `place_robot`.
        link : str
            Of that robot.
        body : SceneBody
            Its ``X_WB``, ``owner`` and ``static`` are set here.
        X_LB : (4, 4) float64
            Pose of the body in the link's frame L [m].

        Raises
        ------
        InvalidArgument, InvalidPose, SceneError
            For a robot or link that is not there, a pose that is none, a name that is taken.
        """
        if checks.text(f"scene {self.name}: owner", owner) not in self.placements:
            raise InvalidArgument(
                f"scene {self.name}: owner must be one of its robots, {listing(self.placements) or 'none'}, "
                f"got {brief(owner)}"
            )
        placement = self.placements[owner]
        if checks.text(f"scene {self.name}: link", link) not in placement.robot.links:
            raise InvalidArgument(
                f"scene {self.name}: robot {owner} has no link {brief(link)}; it has {listing(placement.robot.links)}"
            )
        checks.instance(f"scene {self.name}: body", body, SceneBody, "a SceneBody")
        X_LB = as_pose(X_LB, "X_LB")
        placement.carried[body.name] = (link, X_LB)
        self.add(replace(body, X_WB=placement.body_poses()[body.name], owner=owner, static=False))


def link_body(link: str, elements: tuple[LinkShape, ...]) -> tuple[SceneBody, np.ndarray]:
    """One body for a link, and its pose X_LB in the link: several elements become a compound."""
    about = [element.approximation for element in elements if element.approximation]
    if len(elements) == 1:
        shape, X_LB, approximation = elements[0].shape, elements[0].X_LG, elements[0].approximation
    else:
        shape, X_LB = Compound([(element.shape, element.X_LG) for element in elements]), np.eye(4)
        approximation = f"{len(about)} of {len(elements)} elements: " + "; ".join(about) if about else None
    source = elements[0].source if len(elements) == 1 else elements[0].source.split(": ", 1)[0] + f': link "{link}"'
    return SceneBody(link, shape, np.eye(4), source=source, approximation=approximation), X_LB


def _product(X_WL: np.ndarray, X_LB: np.ndarray) -> np.ndarray:
    """X_WL @ X_LB; the link's own pose, untouched, where the body stands at its origin."""
    return X_WL.copy() if np.array_equal(X_LB, np.eye(4)) else X_WL @ X_LB


def free_name(name: str, taken: dict[str, int]) -> str:
    """``name``, or the first of name_2, name_3, ... that is not taken; it is then.

    taken : name -> the last number tried for it, so that n equal names take n steps.
    """
    free, k = name, taken.get(name, 0)
    while free in taken:
        k += 1
        free = f"{name}_{k}" if k > 1 else name
    taken[name] = max(k, 1)
    taken.setdefault(free, 1)
    return free
