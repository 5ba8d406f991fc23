# SPDX-License-Identifier: MIT
"""Laws of connectors over a step: a linear equation ``α e + β λ = γ``, or row, for each component.

e are the relative motions of all components of a connector at the end of the step.  λ is the force
of the component, which resists the growth of its motion.  The row of a constraint determines e.
Any other law determines λ as a function of e; its row is linearized about the latest iterate.

This module has laws that prescribe a motion or a force, dampers, dry friction, springs, and
rigid-plastic laws, such as plastic hinges of zero length.  Compiled laws and functions of a user
are in compiled_connector_laws.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import ufl

from ufl_beam.arrays import Array, Index
from ufl_beam.compiled.c_library import doubles, ffi, fill, in_order, integers, lib, names, struct
from ufl_beam.discretization.compiled_forms import Pointwise, cached_forms
from ufl_beam.mechanics.connector_equations import parameters, rigid_plastic_step
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.bodies import Place
from ufl_beam.model.connector_laws import (
    RIGID,
    Controller,
    Coulomb,
    Damper,
    Guide,
    PrescribedForce,
    PrescribedMotion,
    RigidPlastic,
    Spring,
)
from ufl_beam.model.connectors import Connector, law_of
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.model.functions import TimeFunction
from ufl_beam.model.material_law import traced
from ufl_beam.model.material_laws import ElastoPlastic
from ufl_beam.model.scene import Scene
from ufl_beam.model.softening_laws import SofteningLaw
from ufl_beam.terms.derivatives import Each, Neighbours, form_derivative, in_c
from ufl_beam.terms.energy_ledger import LEDGER_ENTRIES, Account, Ledger
from ufl_beam.terms.material_points import EXHAUSTED, FREED_STIFFNESS, Points, create_entries
from ufl_beam.terms.term import Callbacks

CREEP = 1e-12
"""Motion of a sticking connector in a step with its limit force; rad, or fraction of scene size.

Sticking connectors creep only if several of them may constrain the same motion.  The creep then
determines how they share the force.
"""


class Setting(NamedTuple):
    """Data of a scene that all responses use."""

    requested_forces: Callable[
        [Connector], Any
    ]  # pointer to the force of a controller, or to the limit of friction
    rates: Any  # ``rates`` of loops.h, with the velocities; None in statics
    scene: Scene
    scheme: Scheme
    ledger: Ledger
    friction_repeats: bool  # True if constraints of sticking connectors may be redundant
    search: Index  # flags shared by all points and connectors, see loops.h
    switched: Index  # whether a row began or ceased to be a constraint since the last tangent; (1,)


class Response:
    """Response of connectors with laws of one kind; motions and forces are (num_connectors,).

    Each component of a :class:`Bushing` counts as a connector.  Later steps change the arrays of
    the attributes.

    Attributes:
        name: Name of the internal variables in files.
        in_c: Fields of ``connectors`` of loops.h that the laws set.
        must_dissipate: True if :meth:`require_dissipation` has to be called before a step is
            accepted.
        opens: Fields of ``openable`` of loops.h if connectors may open or slip by the rule in
            material_points.py; else None.
        needs_accept_end: True if :meth:`accept_end` must be called when a step is accepted.
        motion: Accepted motions that solutions record, (num_connectors,); None if solutions record
            the motions of the nodes.
        flow_direction: Direction of plastic slip in the latest iterate, 1 or -1; 0 without slip.
        sticks: True for each connector that friction holds in the latest iterate; None without
            friction.
        dissipated: Arrays (num_connectors,) of energies lost since the beginning, whose sum is
            ``dissipated`` of :class:`Connection`; J.
        stiffness: Elastic stiffness of laws with internal variables, else zero; N/m or N m/rad.
    """

    must_dissipate = needs_accept_end = False
    opens: dict[str, Any] | None = None
    motion: Array | None = None
    sticks: Index | None = None
    dissipated: Sequence[Array] = ()

    def __init__(self, connectors: Sequence[Connector], setting: Setting, name: str) -> None:
        self._connectors, self._setting, self.name = connectors, setting, name
        self._laws: list[Any] = [connector.law for connector in connectors]
        # Scale of motions: the size of the scene, or a radian
        self._lengths = np.where(
            [connector.is_rotation for connector in connectors], 1.0, setting.scene.size
        )
        self.flow_direction: Index = np.zeros(len(connectors), dtype=np.int32)
        self.stiffness: Array = np.zeros(len(connectors))
        self.in_c: dict[str, Any] = {}
        self._in_steps: dict[str, Any] = {}
        self._time_functions: dict[str, list[tuple[TimeFunction, object]]] = {}
        self._accounts: dict[str, tuple[Account, str]] = {}
        # Arrays of internal variables; all components of a bushing share one value
        self._variables: list[npt.NDArray[Any]] = []
        self._components = 1

    def _enter(self, **accounts: tuple[Account, str]) -> None:
        """Create entries of the ledger; the keywords are the fields in C for their addresses."""
        self._accounts.update(accounts)
        for account, name in accounts.values():
            account[name] += 0.0

    def _rub(self, limits: list[Any], **law_fields: Any) -> None:
        """Set the data of friction in C; ``limits`` are the addresses of the limit forces."""
        n, setting = len(self._connectors), self._setting
        # Direction of slip, or 0, in the iterate and in the accepted state; see ``friction``
        self._direction, self._accepted, distance, creep = np.zeros((4, n))
        self.sticks, against = np.zeros((2, n), dtype=np.int32)
        softness = CREEP if setting.friction_repeats else 0.0
        friction = self.in_c["friction"] = struct(
            "friction", number=n, limit=ffi.new("double *[]", limits), slip=self._direction,
            accepted=self._accepted, way=distance, creep=creep, softness=softness * self._lengths,
            tiny=1e-14 * self._lengths, sticks=self.sticks, against=against,
            switched=setting.switched, **law_fields,
        )  # fmt: skip
        if law_fields:
            excess, free = np.zeros(n), np.zeros(n, dtype=np.int32)
            fill(friction, search=setting.search, excess=excess, free=free)
            self.opens = {"number": n, "excess": doubles(excess), "free": integers(free)}
        if setting.rates is not None:
            fill(friction, rates=setting.rates)
        self._variables.insert(0, self._accepted)

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        """Return fields of ``connector_term`` and of its ``inelastic_term``, see loops.h."""
        places = {field: account.pointer(name) for field, (account, name) in self._accounts.items()}
        wanted = self._time_functions.items()
        functions = {field: callbacks.time_functions(some) for field, some in wanted}
        return {**self._in_steps, **functions, **places}

    def bind_term(self, term: Any) -> None:
        """Store arrays and forms of the :class:`ConnectorForces` ``term`` that the laws need."""
        if self.sticks is not None:
            rate, v = term.motion_rate, term.forms.u
            fill(self.in_c["friction"], rate=rate.cells, at_v=rate.position(v))

    def accept_end(self, e1: Array) -> None:
        """Accept motions ``e1`` before C accepts the step, because users' functions may raise."""

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Return the energy dissipated plastically in a step to the motions ``e1``; J."""
        return 0.0

    def require_dissipation(self, e1: Array) -> None:
        """Raise :class:`StepFailed` if a law generates energy in a step to motions ``e1``."""

    def remaining(self) -> Array:
        """Return the remaining fraction of elastic stiffness in the iterate; (num_connectors,)."""
        return np.where(self.flow_direction == 0, 1.0, 0.0)

    def bends(self, e1: Array) -> Array:
        """Return ∂α/∂e at constant internal variables; (num_connectors / k, k³).

        k is the number of components of a bushing, else 1.
        """
        return np.zeros((len(self._connectors), 1))

    def state(self) -> Array:
        """Return the internal variables; (num_connectors, number of variables)."""
        rows = np.zeros((len(self._connectors) // self._components, len(self._variables)))
        for column, values in zip(rows.T, self._variables, strict=True):
            column[:] = values
        return np.repeat(rows, self._components, axis=0)

    def restore(self, rows: Array) -> None:
        """Restore the internal variables of :meth:`state`."""
        for variable, values in zip(self._variables, rows[:: self._components].T, strict=True):
            variable[:] = values
        if self.sticks is not None:
            self._direction[:] = self._accepted

    def start(self, e: Array) -> None:
        """Set the accepted motions to ``e``, without a step."""

    def borne(self) -> Array | None:
        """Return the elastic forces after :meth:`start`, (num_connectors,); None without any."""
        return None

    def freeze(self) -> None:
        """Make all responses elastic from now on, without further yielding or breaking."""

    def derivatives(
        self, neighbours: Neighbours, term: Any, motions: Any, row: Array
    ) -> list[Each] | None:
        """Return the derivatives of the rows by parameters; None if there are none.

        Args:
            neighbours: The :class:`ConnectorForces` ``term`` in neighbouring scenes.
            term: The term of these connectors.
            motions: ``form_derivative`` of loops.h: the motions by the unknowns, "strains", and
                by the geometry of the connectors, "by_geometry"; and "row_bar", the derivatives
                of the adjoint by the rows.
            row: Array to which C writes the derivatives of the rows by one parameter.
        """
        return None

    def _derivatives_in_c(
        self, neighbours: Neighbours, term: Any, motions: Any, row: Array, **fields: Any
    ) -> list[Each]:
        """Return ``connector_derivatives`` of loops.h with further ``fields``."""
        parameters, number = neighbours.weights.shape
        e1, dt, viscosity_bar, limit_bar, e0_bar = np.zeros((5, len(self._connectors)))
        c = struct(
            "connector_derivatives", parameters=parameters, neighbours=number,
            weight=neighbours.weights, term=term._term_in_c, row=row, dt=dt,
            e0_bar=e0_bar, row_bar=motions["row_bar"], viscosity_bar=viscosity_bar,
            limit_bar=limit_bar, motions=motions["strains"],
            by_geometry=motions["by_geometry"],
            e0=neighbours.state(lambda term: term.motions[0]), e1=e1, **fields,
        )  # fmt: skip
        return [in_c("connectors", c)]

    def _friction_in_c(
        self, neighbours: Neighbours, term: Any, motions: Any, limits: Array
    ) -> dict[str, Any] | None:
        """Return fields of ``connector_derivatives`` for friction with derivatives of its limits.

        The result is None if a parameter changes the geometry of the connectors in dynamics.
        """
        fields = {"limit": limits, "way": np.zeros(limits.shape)}
        if self._setting.rates is None:
            return fields
        if motions["by_geometry"]:
            return None
        forms, rate = term.forms, term.motion_rate
        by = {"rate_by_v": forms.u, "rate_by_q0": forms.q1}
        found = {k: form_derivative(forms.rate, rate, term._form, f) for k, f in by.items()}
        return fields | {k: f for k, f in found.items() if f is not None}

    def _table_in_c(
        self, neighbours: Neighbours, table: Any, inputs: Sequence[str],
        storage: Callable[[Any], Array],
    ) -> dict[str, Any]:  # fmt: skip
        """Return the fields of ``connector_derivatives`` for compiled laws with some inputs."""
        function, by, numbers = table
        column = np.array([inputs.index(name) for name in by], dtype=np.int32)
        changes = neighbours.state(lambda term: storage(term.response))
        tables = np.zeros((len(self._connectors), numbers["outputs"]))
        return {
            "table": function,
            **numbers,
            "column": column,
            "J": tables,
            "w": changes,
            "w_bar": np.zeros(changes[0].shape),
            "width": changes.shape[2],
        }


# -- laws that prescribe a motion or a force -------------------------------------------------------


class PrescribedLaws(Response):
    """Laws that prescribe the motion, the force or its limit: motors, dampers, dry friction, ...

    Joints and guides also prescribe a motion; their forces do no work, and have no ledger entry.
    """

    def __init__(self, law: Any, connectors: Sequence[Connector], setting: Setting) -> None:
        constrained = law is RIGID or isinstance(law, Guide)
        name, account, entry, sign = (
            ("_Held", "", "", 0.0) if constrained else LEDGER_ENTRIES[type(law)]
        )
        super().__init__(connectors, setting, name)
        if not constrained:
            self._enter(entry=(getattr(setting.ledger, account), entry))
            self._in_steps["sign"] = sign
        both = list(zip(self._laws, connectors, strict=True))
        if isinstance(law, PrescribedMotion) and not constrained:
            self._time_functions["wanted_motion"] = [
                (motor.motion, connector) for motor, connector in both
            ]
        elif isinstance(law, Damper):
            self._in_steps["viscosity"] = np.array([damper.viscosity for damper in self._laws])
        elif isinstance(law, Coulomb):
            self._rub([setting.requested_forces(connector) for connector in connectors])
        elif isinstance(law, PrescribedForce | Controller):
            # Forces at the end of this step, and at the end of the last step
            end, reached = np.zeros((2, len(connectors)))
            self._in_steps.update(end=end, reached=reached)
            self._variables = [reached]
            if isinstance(law, PrescribedForce):
                self._time_functions["wanted_force"] = [
                    (load.force, connector) for load, connector in both
                ]
            else:  # the force of a controller is constant in a step
                self._always = np.zeros(1)
                wanted = ffi.new("time_function[]", len(connectors))
                for place, connector in zip(wanted, connectors, strict=True):
                    place.points, place.t, place.y = (
                        1,
                        doubles(self._always),
                        setting.requested_forces(connector),
                    )
                self._in_steps["wanted_force"] = wanted

    def derivatives(
        self, neighbours: Neighbours, term: Any, motions: Any, row: Array
    ) -> list[Each] | None:
        """See the base class."""
        fields: dict[str, Any] = {}
        shape = len(neighbours), len(self._connectors)
        if "viscosity" in self._in_steps:
            fields["viscosity"] = neighbours.differences(
                lambda term: term.response._in_steps["viscosity"]
            )
        elif self._time_functions:  # motors and actuators
            now, end = np.zeros((2, *shape))
            others = [x._term_in_c for some in neighbours.terms for x in some]
            fields = {"now": now, "end": end, "neighbour": ffi.new("connector_term *[]", others)}
            if "wanted_force" in self._time_functions:
                fields["reached"] = neighbours.state(
                    lambda term: term.response._in_steps["reached"]
                )
        elif self.sticks is not None and not any(law.joint for law in self._laws):
            limits = neighbours.differences(
                lambda term: np.array([law.force for law in term.response._laws])
            )
            if (found := self._friction_in_c(neighbours, term, motions, limits)) is None:
                return None
            fields = found
        elif self.sticks is None and not self._in_steps:
            return []  # constraints
        else:
            return None
        return self._derivatives_in_c(neighbours, term, motions, row, **fields)


# -- springs ---------------------------------------------------------------------------------------


class Springs(Response):
    """Springs of one law, which may yield and break: material points whose strain is the motion."""

    def __init__(self, law: Spring, connectors: Sequence[Connector], setting: Setting) -> None:
        super().__init__(connectors, setting, "_Sprung")
        softening, number = law.softening, len(connectors)
        self.stiffness[:] = law.stiffness
        section_points = SectionPoints(
            strains=np.array([[1.0, 0.0, 0.0]]),
            weights=np.ones(1),
            stiffness=np.array([law.stiffness]),
            laws=((law.bulk, 1),),
            rest=np.zeros(3),
            softening=softening if softening is not None and softening.opens else None,
            breaking=slice(0, None),
        )
        keys = [setting.scene.stream_keys[connector] for connector in connectors]
        self.points = Points(section_points, keys, np.ones(number), setting.scheme, setting.search)
        create_entries(section_points, setting.scheme, setting.ledger)
        self._strains = np.zeros((number, 3))
        self.must_dissipate = section_points.kind.law.must_dissipate
        self.in_c = {"points": self.points.c}
        self.opens = self.in_c if self.points.softens else None
        self.dissipated = self.points.recorded[:, 4], self.points.recorded[:, 5]

    def in_steps(self, callbacks: Callbacks) -> dict[str, Any]:
        """Return fields of ``inelastic_term`` of loops.h, with entries of the ledger."""
        return self.points.in_steps(self._setting.ledger)

    def _at(self, e: Array) -> Array:
        self._strains[:, 0] = e
        return self._strains

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Return the energy dissipated by springs in a step to the motions ``e1``; J."""
        self.points.return_map(self._at(e1))
        return self.points.dissipation()

    def require_dissipation(self, e1: Array) -> None:
        """Raise :class:`StepFailed` if a law generates energy in a step to motions ``e1``."""
        self.points.return_map(self._at(e1))
        self.points.require_dissipation(lambda number: str(self._connectors[number]))

    def remaining(self) -> Array:
        """Return the remaining fraction of elastic stiffness in the iterate; (num_connectors,)."""
        now, elastic = self.points.works(np.eye(1, 3).repeat(len(self._strains), axis=0))
        left = np.divide(now, elastic, out=np.ones(len(now)), where=elastic > 0)
        return np.asarray(left)

    def state(self) -> Array:
        """Return the internal variables of the points."""
        return self.points.state()

    def restore(self, rows: Array) -> None:
        """Restore the variables of :meth:`state`."""
        self.points.restore(rows)

    def derivatives(
        self, neighbours: Neighbours, term: Any, motions: Any, row: Array
    ) -> list[Each] | None:
        """See the base class."""
        c = self.points.derivatives(
            neighbours, "response.points", springs=term._in_c, row=row, **motions,
        )  # fmt: skip
        return [in_c("points", c)]

    def start(self, e: Array) -> None:
        """Set the accepted motions to ``e``, without a step."""
        self.points.start(self._at(e))
        self.points.refresh(self._at(e))

    def borne(self) -> Array | None:
        """Return the forces of the springs."""
        return self.points.recorded[:, 0]

    def freeze(self) -> None:
        """Keep springs elastic from now on."""
        self.points.freeze()


# -- rigid-plastic laws ---------------------------------------------------------------------------

INPUTS = (*names("slip_input", "slip_"), "θ", "dt")
"""First inputs of the compiled laws: slip in the step, its direction (1 or -1), accumulated slip at
t_n, motion at t_n, θ, and length of the step (s).

The first four are in the order of ``slip_input`` in loops.h.  The parameters of the law follow.
"""


class RigidPlasticForms:
    """C functions of a rigid-plastic law: force and derivative; ``slip_output`` of loops.h."""

    def __init__(self, law: SofteningLaw | ElastoPlastic, scheme: Scheme) -> None:
        self._pointwise = pointwise = Pointwise((*INPUTS, *parameters(law)))
        self._law, self._scheme = law, scheme
        at = {**pointwise.at, "slip": ufl.variable(pointwise.at["slip"])}
        with traced(law):
            end = rigid_plastic_step(law, at, scheme)._asdict()
            force = end.pop("force")
            slope = ufl.diff(force, at["slip"])
        self._response = force, slope
        self.force = pointwise.compile(*self._response)
        self.end = pointwise.compile(*in_order("slip_output", end, "slip_"))

    @cached_property
    def table(self) -> tuple[Any, list[str], dict[str, int]]:
        """Derivatives of force, limit and back force with respect to the inputs, see loops.h.

        Returns:
            A C function, the inputs by which it differentiates, and numbers of
            ``connector_derivatives`` of loops.h.
        """
        inputs = self._pointwise.at
        by = [name for name in inputs if name not in ("direction", "θ", "dt")]
        at = inputs | {name: ufl.variable(inputs[name]) for name in by}
        with traced(self._law):
            step = rigid_plastic_step(self._law, at, self._scheme)
        outputs = map(ufl.as_ufl, (step.force, step.limit, step.back_force))
        slopes = [ufl.diff(x, at[name]) for x in outputs for name in by]
        numbers = {"rows": 3, "columns": len(by), "outputs": len(slopes)}
        return self._pointwise.compile(*slopes), by, numbers

    @cached_property
    def spent(self) -> Any:
        """C function of force and derivative, reduced by the factor ``FREED_STIFFNESS``."""
        return self._pointwise.compile(*(FREED_STIFFNESS * x for x in self._response))


_rigid_plastic_forms = cached_forms(RigidPlasticForms)


REFERENCE_MOTION = 0.01
"""Motion m for which r m is the limit force, in rad or as a fraction of scene size.

The factor r of rigid_plastic.c decides whether a connector slips in an iterate; solutions do not
depend on it.
"""

LEAST_SLOPE = 1e-9
"""Least r in rigid_plastic.c, as a multiple of EI of the beam divided by the size of the scene."""


def _slope(connector: Connector, size: float) -> float:
    """Return r, the factor of the motion in the equation of a connector, see rigid_plastic.c.

    r exceeds the steepest slope of softening, so that an open hinge stays open.  For weak hinges r
    is large enough that the motion, not the round-off of the force, decides the direction of slip.
    """
    law = law_of(connector)
    if not 0.0 < law.limit < np.inf:
        return 1.0
    steepest, _ = law.steepest
    early = law.limit / (REFERENCE_MOTION * (1.0 if connector.is_rotation else size))
    least = (
        LEAST_SLOPE * connector.a.beam.section.EI / size if isinstance(connector.a, Place) else 0.0
    )
    return float(max(early, least)) + (2 * steepest if steepest < np.inf else 0.0)


class RigidPlasticLaws(Response):
    """Rigid-plastic connectors with laws of one kind; see rigid_plastic.c.

    A constraint holds a connector until its force reaches the limit of its law.  Then the law
    gives the force as a function of the slip in the step.
    """

    def __init__(
        self, law: RigidPlastic, connectors: Sequence[Connector], setting: Setting
    ) -> None:
        super().__init__(connectors, setting, "CompiledSlips")
        n, ledger, scheme = len(connectors), setting.ledger, setting.scheme
        self._enter(hinges=(ledger.lost, "hinges"))
        self._hardens = isinstance(law.law, ElastoPlastic)
        loss = 2 * scheme.alpha if self._hardens else 0.0
        if self._hardens:
            self._enter(hardening=(ledger.state, "hardening"))
        if loss:
            self._enter(numerical=(ledger.lost, "numerical"))
        inputs = (*INPUTS, *parameters(law.law))
        self._storage = np.zeros((n, len(inputs)))
        self._at = {name: self._storage[:, i] for i, name in enumerate(inputs)}
        laws = [law_of(connector) for connector in connectors]
        numbers = {id(x): parameters(x) for x in laws}  # hinges of a frame share a law
        for i, x in enumerate(laws):
            for name, value in numbers[id(x)].items():
                self._at[name][i] = value
        self._at["θ"][:], self._at["dt"][:] = scheme.theta, 1.0
        self._initial_limit = self._at["number yield_limit" if self._hardens else "number limit"]
        self._limit = self._initial_limit.copy()
        back_force, dissipated, excess = np.zeros((3, n))
        self._back_force = back_force
        self.flow_direction, direction_before, free = np.zeros((3, n), dtype=np.int32)
        self.opens = {"number": n, "excess": doubles(excess), "free": integers(free)}
        self._stored = np.zeros(1)  # energy of hardening of all connectors together; J
        at = self._at["slipped"], self._at["start"]
        self._variables = [*at, self._limit, back_force, dissipated, direction_before]
        # The sum of the increments is stored: motions of nodes have the round-off of constraints
        self.motion, self.dissipated = self._at["start"], (dissipated,)

        kind = ElastoPlastic(1.0) if isinstance(law.law, ElastoPlastic) else law.law.kind()
        self._forms = _rigid_plastic_forms(kind, scheme)
        self._c = struct(
            "rigid_plastic", number=n, width=len(inputs), w=self._storage,
            force=self._forms.force, end=self._forms.end, search=setting.search,
            limit=self._limit, back_force=back_force, dissipated=dissipated,
            slope=np.array([_slope(connector, setting.scene.size) for connector in connectors]),
            excess=excess, free=free, direction=self.flow_direction,
            direction_before=direction_before,
        )  # fmt: skip
        self.in_c = {"rigid_plastic": self._c}
        self._in_steps = {"dt_of_law": INPUTS.index("dt"), "hardened": self._stored, "loss": loss}

    def dissipation(self, e1: Array, λ: Array) -> float:
        """Return the energy dissipated in a step to the motions ``e1``; J.

        For a held connector with a force above its limit, the excess times 1 m or 1 rad is added.
        """
        arrays = doubles(e1), doubles(np.ascontiguousarray(λ))
        return float(lib.dissipation_of_rigid_plastic(self._c, *arrays))

    def derivatives(
        self, neighbours: Neighbours, term: Any, motions: Any, row: Array
    ) -> list[Each] | None:
        """See the base class."""
        table = self._table_in_c(
            neighbours, self._forms.table, tuple(self._at), lambda laws: laws._storage
        )
        for field, name in (("limit", "_limit"), ("back_force", "_back_force")):
            table[field] = neighbours.state(attrgetter(f"response.{name}"))
        return self._derivatives_in_c(neighbours, term, motions, row, **table)

    def state(self) -> Array:
        """Return the internal variables; (num_connectors, 7)."""
        stored = np.zeros(len(self._connectors))  # any row may store the sum
        stored[:1] = self._stored
        return np.column_stack([super().state(), stored])

    def restore(self, rows: Array) -> None:
        """Restore the variables of :meth:`state`."""
        super().restore(rows[:, :-1])
        self._stored[0] = rows[:, -1].sum()

    def start(self, e: Array) -> None:
        """Set the accepted motions to ``e``, without a step."""
        self._at["start"][:] = e

    def freeze(self) -> None:
        """Hold connectors from now on; connectors with exhausted limits move freely."""
        spent = self._limit <= EXHAUSTED * self._initial_limit
        self._limit[:] = np.where(spent, 0.0, np.inf)
        if not self._hardens:
            self._c.force = self._forms.spent
