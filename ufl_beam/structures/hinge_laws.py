# SPDX-License-Identifier: MIT
"""Laws of hinges: deterioration by dissipated energy, and interaction of N and M."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial, reduce
from typing import Annotated, Any, ClassVar, NamedTuple

from ufl_beam.errors import ModelError, closed
from ufl_beam.model.checks import require_number
from ufl_beam.model.connector_law import ConnectorLaw
from ufl_beam.model.law_functions import (
    Values,
    absolute,
    below,
    larger,
    positive,
    sign,
    smaller,
    where,
)
from ufl_beam.model.material_law import State
from ufl_beam.model.records import Instance, Number, Positive, Record

OWN_LAW = "state a ConnectorLaw of your own"
"""Advice in the error that a subclass of a closed class raises."""

FALL = 0.1
"""Longest fall to zero strength after the ultimate rotation, as a fraction of this rotation."""

LEAST_STIFFNESS = 0.1  # smallest unloading stiffness, as a fraction of the elastic stiffness

STEEPER = 1.1
"""Smallest unloading stiffness after pinching, divided by the slope of the reloading path."""

UNBOUNDED = 1e100  # number that stands for infinity, for which compiled expressions would be NaN

FromZeroOrInfinite = Annotated[float, partial(require_number, positive=True, infinite=True)]
AtLeastOne = Annotated[float, partial(require_number, at_least=1.0)]


@closed(OWN_LAW)
@dataclass(frozen=True)
class Backbone(Record):
    """Backbone of a hinge in one direction: yielding, capping, residual and ultimate rotation.

    Rotations are in rad and moments in N m; for forces they are displacements in m and N.  The
    moment grows by the factor ``overstrength`` from the yield rotation to the capping rotation,
    which is larger by ``capping``.  Then it falls along a straight line, which would reach zero
    after the rotation ``post_capping``, to the fraction ``residual`` of the yield moment.

    Args:
        yield_limit: Effective yield moment; N m.
        capping: Plastic rotation from yielding to capping; rad.
        post_capping: Rotation from capping to zero moment; rad.  The default, infinity, means that
            the moment does not fall.
        overstrength: Capping moment divided by the yield moment, at least 1.
        residual: Residual moment divided by the yield moment, from 0 to 1.
        ultimate: Rotation, elastic part included, after which the moment falls to zero within at
            most a tenth of this rotation, and at least twice as steeply as after capping; rad.

    Raises:
        ModelError: A number is out of range, or the backbone turns back.

    Example:
        >>> steel = st.Backbone(  # N m; rad
        ...     3e5, capping=0.025, post_capping=0.2, overstrength=1.1, residual=0.4, ultimate=0.3
        ... )
    """

    yield_limit: Positive
    capping: Number
    post_capping: FromZeroOrInfinite = math.inf
    overstrength: AtLeastOne = 1.0
    residual: Number = 0.0
    ultimate: FromZeroOrInfinite = math.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.capping <= 0.0:
            raise ModelError(
                f"Backbone: capping = {self.capping:g} rad is the plastic rotation from yielding "
                "to capping; the backbone would turn back at the yield moment, so give a positive "
                "rotation"
            )
        if not 0.0 <= self.residual <= 1.0:
            raise ModelError(
                f"Backbone: residual = {self.residual:g} is a fraction of the yield moment and "
                "must lie between 0 and 1; above it the moment would rise again"
            )
        if self.ultimate <= self.capping:
            raise ModelError(
                f"Backbone: the ultimate rotation {self.ultimate:g} rad must exceed the capping "
                f"rotation, whose plastic part is {self.capping:g} rad"
            )

    def data(self, stiffness: float) -> dict[str, float]:
        """Return intercepts and slopes of the lines of the backbone, for an elastic stiffness."""
        limit, yields = self.yield_limit, self.yield_limit / stiffness
        caps, largest = yields + self.capping, self.overstrength * limit
        hardening = (largest - limit) / self.capping
        if self.ultimate <= caps:
            raise ModelError(
                f"Backbone: the ultimate rotation {self.ultimate:g} rad must exceed the capping "
                f"rotation {caps:g} rad, the yield rotation {yields:g} rad and its plastic part"
            )
        if hardening > stiffness / 2:
            raise ModelError(
                f"Backbone: between the yield rotation {yields:g} rad and the capping rotation "
                f"{caps:g} rad the slope is {hardening:.4g} N m/rad; it must be at most half the "
                f"elastic stiffness {stiffness:.4g} N m/rad"
            )
        falls = largest / self.post_capping
        last, steep, ultimate = 2 * largest, 0.0, 0.0
        if math.isfinite(self.ultimate):
            ultimate = self.ultimate
            last = max(largest - falls * (ultimate - caps), self.residual * limit)
            last = last if last > 0.0 else largest  # the strength is lost before
            steep = max(last / (FALL * ultimate), 2 * falls)
        return {
            "first": limit - hardening * yields,
            "hardening": hardening,
            "reference": largest + falls * caps,
            "falls": falls,
            "residual": self.residual * limit,
            "last": last,
            "top": last + steep * ultimate,
            "steep": steep,
            "largest": largest,
        }


class _Line(NamedTuple):
    """Straight line of moments over rotations."""

    intercept: Values
    slope: Values

    def at(self, x: Values) -> Values:
        return self.intercept + self.slope * x

    def meets(self, stiffness: Values, p: Values) -> Values:
        """Return the rotation where an elastic line, which starts at ``p``, meets this one."""
        return (self.intercept + stiffness * p) / (stiffness - self.slope)

    def crosses(self, other: _Line, least_slope: float) -> Values:
        """Return the rotation where a less steep line crosses this one."""
        return (other.intercept - self.intercept) / larger(self.slope - other.slope, least_slope)


class _Bound(NamedTuple):
    """Bound of positive moments: lines of a deteriorated backbone."""

    hardening: _Line
    falling: _Line
    residual: _Line
    most: _Line  # largest moment
    breaking: _Line  # after the ultimate rotation
    least_slope: float  # in place of zero, where a slope is a divisor

    def _of(self, value: Callable[[_Line], Values]) -> Values:
        """Combine moments on the lines, or rotations where an elastic line meets them."""
        lines = smaller(value(self.hardening), value(self.falling))
        bound = smaller(value(self.most), larger(value(self.residual), lines))
        return smaller(value(self.breaking), bound)

    def at(self, x: Values) -> Values:
        return positive(self._of(lambda line: line.at(x)))

    def meets(self, stiffness: Values, p: Values) -> Values:
        """Return the rotation where an elastic line, which starts at ``p``, meets the bound."""
        return larger(p, self._of(lambda line: line.meets(stiffness, p)))

    def kinks(self) -> list[Values]:
        """Return rotations between which the bound is linear, in increasing order."""

        def at(one: _Line, other: _Line) -> Values:
            return one.crosses(other, self.least_slope)

        hardening, falling, residual, most, breaking, _ = self
        caps, none = at(hardening, falling), _Line(0.0, 0.0)
        breaks = smaller(at(residual, breaking), at(falling, breaking))
        breaks = larger(at(most, breaking), breaks)
        rising = [smaller(caps, at(hardening, line)) for line in (residual, most)]
        falls = [larger(caps, at(line, falling)) for line in (most, residual)]
        before = [smaller(kink, breaks) for kink in rising + falls]
        return [*before, breaks, at(none, breaking)]


class _Reloading(NamedTuple):
    """Bound of positive moments that follows two lines to a target, then the backbone."""

    backbone: _Bound
    start: Values  # rotation where the first line begins at zero moment
    first: _Line
    second: _Line  # never less steep
    target: Values  # rotation where the second line ends

    def at(self, x: Values) -> Values:
        lines = positive(larger(self.first.at(x), self.second.at(x)))
        return where(below(x, self.target), lines, self.backbone.at(x))

    def meets(self, stiffness: Values, p: Values) -> Values:
        """Return the rotation where an elastic line, which starts at ``p``, meets the bound."""
        lines = larger(self.first.meets(stiffness, p), self.second.meets(stiffness, p))
        x = larger(p, lines)
        return where(below(x, self.target), x, self.backbone.meets(stiffness, p))

    def kinks(self) -> list[Values]:
        """Return rotations between which the bound is linear, in increasing order."""
        corner = self.second.crosses(self.first, self.backbone.least_slope)
        before = [smaller(kink, self.target) for kink in (self.start, corner)]
        return [*before, self.target, *self.backbone.kinks()]


def _integral(bound: _Bound | _Reloading, start: Values, end: Values) -> Values:
    """Return the integral of a bound from ``start`` to ``end``, by trapezoids between kinks."""
    total, x, value = 0.0, start, bound.at(start)
    for kink in (*bound.kinks(), end):
        next_x = smaller(end, larger(x, kink))
        next_value = bound.at(next_x)
        total += (next_x - x) * (value + next_value) / 2
        x, value = next_x, next_value
    return total


@dataclass(frozen=True)
class _DeterioratingHinge(Record, ConnectorLaw):
    """Base of hinges that deteriorate by dissipated energy."""

    stiffness: Positive
    backbone: Instance[Backbone]
    negative: Instance[Backbone | None] = None
    strength: FromZeroOrInfinite = math.inf
    softening: FromZeroOrInfinite = math.inf
    unloading: FromZeroOrInfinite = math.inf
    exponent: AtLeastOne = 1.0

    entry = "plastic"
    rate_independent: ClassVar[bool] = True
    modes: ClassVar[tuple[str, ...]] = "strength", "softening", "unloading"
    variables: ClassVar[Mapping[str, float]] = {
        "plastic": 0.0,  # motion at zero moment on the present elastic line
        "side": 1.0,  # sign of the moments of the present excursion
        "dissipated": 0.0,  # in the present excursion
        "spent": 0.0,  # in all excursions before
        "rest": 1.0,  # unloading stiffness divided by the elastic one
        "rest_before": 1.0,  # the same when the excursion began
        # factors of the hardening line, of the reference moment and of the capping moment
        **{f"{name}_{side}": x for side in ("plus", "minus")
           for name, x in (("basic", 1.0), ("falling", 1.0), ("most", 1.0))},
    }  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        data = {
            f"{name}_{side}": x
            for side, backbone in self._backbones.items()
            for name, x in backbone.data(self.stiffness).items()
        }
        limit = self.backbone.yield_limit
        for name in self.modes:
            data[f"{name}_energy"] = min(getattr(self, name) * limit, UNBOUNDED)
        slope = max(data["hardening_plus"], data["hardening_minus"])
        data["least"] = max(LEAST_STIFFNESS, 2 * slope / self.stiffness)
        data |= {"stiffness": self.stiffness, "exponent": self.exponent}
        vars(self).update(data, _numbers=data)

    @property
    def _backbones(self) -> dict[str, Backbone]:
        return {"plus": self.backbone, "minus": self.negative or self.backbone}

    def parameters(self) -> dict[str, Any]:
        """Return the numbers of the lines of both backbones, and the reference energies."""
        return dict(vars(self)["_numbers"])

    @property
    def elastic_rotation(self) -> tuple[float, float]:
        """Elastic stiffness (N m/rad), and the lower of the two yield limits (N m)."""
        return self.stiffness, min(x.yield_limit for x in self._backbones.values())

    def energy(self, motion: Values, state: State) -> Values:
        return state.rest * self.stiffness * (motion - state.plastic) ** 2 / 2

    def increments(
        self, motion: Values, rate: Values, state: State, dt: Values
    ) -> Mapping[str, Values]:
        """Return the changes of the variables on a monotone way to the motion."""
        data, stiffness = vars(self), state.rest * self.stiffness
        direction = sign(motion - state.plastic)  # of the moment
        x, p = direction * motion, direction * state.plastic
        crosses = below(direction * state.side, 0.0)

        def sided(name: str, source: Mapping[str, Values] = data) -> Values:
            return where(below(direction, 0.0), source[f"{name}_minus"], source[f"{name}_plus"])

        def lost(capacity: Values, spent: Values, energy: Values) -> Values:
            """Return β^(1/c), at most 1."""
            left = larger(capacity - spent - energy, 1e-12 * capacity)
            return smaller(positive(energy) / left, 1.0)

        # the end of an excursion
        ended = where(crosses, state.dissipated, 0.0)
        ratios = {name: lost(data[f"{name}_energy"], state.spent, ended) for name in self.modes}
        basic = sided("basic", vars(state)) * (1 - ratios["strength"] ** self.exponent)
        falling = sided("falling", vars(state)) * (1 - ratios["softening"] ** self.exponent)
        works = below(reduce(larger, ratios.values()), 1.0)
        most = where(works, sided("most", vars(state)), 0.0)
        reverse = where(works, where(below(direction, 0.0), state.most_plus, state.most_minus), 0.0)
        spent, dissipated = state.spent + ended, state.dissipated - ended
        before = where(crosses, state.rest, state.rest_before)

        # the bound, at x >= 0 of moments that are positive in this excursion
        backbone = _Bound(
            hardening=_Line(basic * sided("first"), basic * sided("hardening")),
            falling=_Line(falling * sided("reference"), -sided("falls")),
            residual=_Line(sided("residual"), 0.0),
            most=_Line(most * sided("largest"), 0.0),
            breaking=_Line(sided("top"), -sided("steep")),
            least_slope=1e-12 * self.stiffness,
        )
        bound, path = self._path(backbone, state, crosses, p, before, ratios, sided)
        limit = bound.at(x)
        flows = below(limit, stiffness * (x - p))
        start = bound.meets(stiffness, p)
        work = dissipated + stiffness * (start - p) ** 2 / 2
        work += _integral(bound, start, larger(x, start))
        energy = work - limit**2 / (2 * before * self.stiffness)
        ratio = lost(data["unloading_energy"], spent, energy)
        least = larger(data["least"], path["least_rest"]) if path else data["least"]
        rest = larger(before * (1 - ratio**self.exponent), smaller(before, least))
        after = rest * self.stiffness

        def changed(new: Values, old: Values) -> Values:
            return where(flows, new, old)

        breaking = backbone.breaking.at(x)
        fallen = larger(backbone.residual.intercept, backbone.falling.at(x))
        fallen = smaller(most, positive(smaller(breaking, fallen)) / sided("largest"))
        if path:  # on the way to the target the moment is below the backbone
            fallen = where(below(x, path["target"]), most, fallen)
        most = changed(fallen, most)
        reverse = changed(smaller(reverse, positive(breaking) / sided("last")), reverse)
        new = {
            "plastic": direction * changed(x - limit / after, p),
            "side": direction,
            "dissipated": changed(work - limit**2 / (2 * after), dissipated),
            "spent": spent,
            "rest": changed(rest, state.rest),
            "rest_before": before,
            **path,
        }
        for side, is_here in (("plus", below(-direction, 0.0)), ("minus", below(direction, 0.0))):
            for name, value in (("basic", basic), ("falling", falling)):
                new[f"{name}_{side}"] = where(is_here, value, getattr(state, f"{name}_{side}"))
            new[f"most_{side}"] = where(is_here, most, reverse)
            if path:
                peak = getattr(state, f"peak_{side}")
                aims = where(crosses, path["target"] / sided("yields"), peak)
                reached = larger(aims, changed(x / sided("yields"), aims))
                new[f"peak_{side}"] = where(is_here, reached, peak)
        return {name: value - getattr(state, name) for name, value in new.items()}

    def _path(
        self, backbone: _Bound, state: State, crosses: Values, p: Values, before: Values,
        ratios: Mapping[str, Values], sided: Callable[..., Values],
    ) -> tuple[_Bound | _Reloading, dict[str, Values]]:  # fmt: skip
        """Return the bound of an excursion, and the new values of the variables of its path.

        Args:
            backbone: Deteriorated backbone in the direction of the moment.
            state: Variables at the beginning of the step.
            crosses: True where the moment changes its sign in the step: an excursion begins.
            p: Plastic rotation, positive in the direction of the moment.
            before: Unloading stiffness before this excursion, as a fraction of the elastic one.
            ratios: Ratios β^(1/c) of the excursion that ends, by the names of the modes.
            sided: Function that returns a variable or number of the direction of the moment.
        """
        return backbone, {}


@closed(OWN_LAW)
@dataclass(frozen=True)
class IbarraKrawinkler(_DeterioratingHinge):
    """Bilinear hysteresis with capping, residual strength and deterioration by dissipated energy.

    The moment moves elastically between two bounds, which are the backbones of both directions;
    their hardening lines stay in place (kinematic hardening).  An excursion ends where the moment
    changes its sign.  If n excursions have dissipated the energies E_1 to E_n, the last one causes

    β = (E_n / (Λ My - sum E_i))^c

    with the yield moment My of ``backbone`` and the sum of all n energies, E_n included.  The
    hardening line of the direction in which the moment begins to grow is then multiplied by 1 - β
    with Λ = ``strength``, and the intercept of its falling line with the axis of moments by 1 - β
    with Λ = ``softening``.  The residual moment does not deteriorate: up to the ultimate rotation
    both lines count where they are above it.  A moment that was reached on the falling line is
    never exceeded again.  The unloading stiffness changes at each reversal from the bound: it is
    the stiffness at the beginning of the excursion, multiplied by 1 - β with Λ = ``unloading``,
    where E_n is the energy that this excursion has dissipated up to the reversal.  It remains above
    a tenth of the elastic one and above twice the hardening slope, and changes neither on elastic
    lines nor where the moment changes its sign.  When one of the β reaches 1, the moment is
    zero after the end of the excursion.  The entry "plastic" of the ledger is the work minus the
    energy M²/2K that unloading with the present stiffness K would return.  It falls where K falls
    fast at a nearly constant moment.  After Ibarra, Medina and Krawinkler, Earthquake Eng.
    Struct. Dyn. 34 (2005), and Lignos and Krawinkler, J. Struct. Eng. 137 (2011).

    Args:
        stiffness: Elastic stiffness; N m/rad or N/m.
        backbone: Backbone of positive moments, and of negative ones unless ``negative`` is given.
        negative: Backbone of negative moments, with positive numbers.
        strength: Reference cumulative rotation Λ of the basic strength; rad or m.  The default,
            infinity, means no deterioration, here and below.
        softening: Λ of the strength after capping; rad or m.
        unloading: Λ of the unloading stiffness; rad or m.
        exponent: Exponent c, at least 1.

    Raises:
        ModelError: A number is out of range, the hardening exceeds half the stiffness, or the
            ultimate rotation does not exceed the capping rotation.

    Example:
        >>> backbone = st.Backbone(3e5, capping=0.025, post_capping=0.2, overstrength=1.1)
        >>> law = st.IbarraKrawinkler(3e7, backbone, strength=1.0, softening=1.0, unloading=2.0)
        >>> base = ub.Turn(ub.ground(0, 0), beam.start, law)
        >>> arm = ub.Scene([beam], supports=[ub.Pinned(beam.start)], connectors=[base])
    """


@closed(OWN_LAW)
@dataclass(frozen=True)
class PinchingHinge(_DeterioratingHinge):
    """Peak-oriented or pinching hysteresis with the backbone of Ibarra, Medina and Krawinkler.

    Backbones and deterioration are as in :class:`IbarraKrawinkler`.  Where the moment changes
    its sign, at the rotation x0, the path aims at the largest rotation of earlier excursions in
    the new direction, at first the yield rotation, and at its moment M on the deteriorated
    backbone.  With ``kappa_F`` = 1 the path is straight (peak-oriented).  Otherwise it has two
    lines, which meet at 1 - ``kappa_D`` times the rotation that unloading from the target leaves,
    and at ``kappa_F`` times the moment of the straight path; if x0 is beyond this rotation, the
    path is straight.  At each change of the sign the target rotation is multiplied by 1 + β with
    Λ = ``reloading``.  The unloading stiffness remains at least 1.1 times the slope of the path
    where this slope is less than the stiffness before.  After Ibarra, Medina and Krawinkler,
    Earthquake Eng. Struct. Dyn. 34 (2005); IMKPinching and IMKPeakOriented in OpenSees.

    Args:
        stiffness, backbone, negative: As of :class:`IbarraKrawinkler`, like the next two rows.
        strength, softening, unloading: Reference rotations Λ; rad or m.
        exponent: Exponent c, at least 1.
        kappa_F: Factor κF of the moment where both lines meet, above 0 and at most 1.
        kappa_D: Factor κD of the rotation there, from 0 to 1.
        reloading: Λ of the accelerated deterioration of the reloading stiffness; rad or m.

    Raises:
        ModelError: A number is out of range, the hardening exceeds half the stiffness, or the
            ultimate rotation does not exceed the capping rotation.

    Example:
        >>> backbone = st.Backbone(3e5, capping=0.025, post_capping=0.2, overstrength=1.1)
        >>> law = st.PinchingHinge(3e7, backbone, strength=1.0, kappa_F=0.4, kappa_D=0.3)
        >>> base = ub.Turn(ub.ground(0, 0), beam.start, law)
        >>> arm = ub.Scene([beam], supports=[ub.Pinned(beam.start)], connectors=[base])
    """

    kappa_F: Annotated[float, partial(require_number, positive=True, at_least=0, at_most=1)] = 1.0
    kappa_D: Annotated[float, partial(require_number, at_least=0, at_most=1)] = 0.0
    reloading: FromZeroOrInfinite = math.inf

    modes: ClassVar[tuple[str, ...]] = (*_DeterioratingHinge.modes, "reloading")
    variables: ClassVar[Mapping[str, float]] = {
        **_DeterioratingHinge.variables,
        "start": 0.0,  # motion where the present excursion began
        "target": 0.0,  # size of the motion at which its path aims
        "least_rest": 0.0,  # lower bound of the unloading stiffness divided by the elastic one
        "peak_plus": 1.0,  # largest motions divided by the yield rotations
        "peak_minus": 1.0,
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        sides = self._backbones.items()
        yields = {f"yields_{side}": x.yield_limit / self.stiffness for side, x in sides}
        more = yields | {name: getattr(self, name) for name in ("kappa_F", "kappa_D")}
        vars(self)["_numbers"].update(more)
        vars(self).update(more)

    def _path(
        self, backbone: _Bound, state: State, crosses: Values, p: Values, before: Values,
        ratios: Mapping[str, Values], sided: Callable[..., Values],
    ) -> tuple[_Bound | _Reloading, dict[str, Values]]:  # fmt: skip
        stiffness, least = before * self.stiffness, 1e-12 * sided("yields")
        farther = 1 + ratios["reloading"] ** self.exponent
        aims = sided("peak", vars(state)) * sided("yields") * farther
        target = where(crosses, aims, state.target)
        start = where(crosses, p, state.start)
        moment = backbone.at(target)
        slope = moment / larger(target - start, least)
        remains = target - moment / stiffness
        kink = remains - self.kappa_D * positive(remains)
        first = where(below(start, kink), self.kappa_F * slope, slope)
        second = (moment - first * (kink - start)) / larger(target - kink, least)
        second = where(below(start, kink), second, slope)
        # otherwise the elastic line reaches the backbone before the target
        reloads = below((1 + 1e-6) * moment, stiffness * (target - start))
        first, second = where(reloads, first, 0.0), where(reloads, second, 0.0)
        lines = _Line(-first * start, first), _Line(moment - second * target, second)
        bound = _Reloading(backbone, start, *lines, where(reloads, target, -UNBOUNDED))
        least_rest = where(crosses, STEEPER * second / self.stiffness, state.least_rest)
        return bound, {"start": start, "target": target, "least_rest": least_rest}


# -- interaction of N and M ------------------------------------------------------------------------

ITERATIONS = 8
"""Newton iterations for the flow, which converge to round-off from the lower bound of the flow."""


@closed(OWN_LAW)
@dataclass(frozen=True)
class AxialBendingHinge(Record, ConnectorLaw):
    """Law of a :class:`Bushing` for a hinge that yields by (N/Np)² + abs(M)/Mp = 1.

    The yield surface is the one of :class:`AxialBending` with sharp corners, with associated flow.
    The components are the motion along the axis of the bushing, with the axial force N; across it,
    elastic; and the rotation, with the moment M.

    Args:
        axial: Np, the yield force; N.
        bending: Mp, the plastic moment; N m.
        along: Elastic stiffness along the axis; N/m.
        across: Elastic stiffness across the axis; N/m.
        turning: Elastic stiffness of the rotation; N m/rad.

    Raises:
        ModelError: A number is not positive.

    Example:
        >>> law = st.AxialBendingHinge(  # N, N m; N/m, N/m, N m/rad
        ...     axial=5e6, bending=2.5e5, along=1e10, across=1e10, turning=1e9
        ... )
        >>> foot = ub.Bushing(ub.ground(0, 0), beam.start, law, axis=(1, 0))
        >>> cantilever = ub.Scene([beam], connectors=[foot])
    """

    axial: Positive
    bending: Positive
    along: Positive
    across: Positive
    turning: Positive

    entry = "plastic"
    components: ClassVar[int] = 3
    variables: ClassVar[Mapping[str, float]] = {"stretch": 0.0, "rotation": 0.0}

    @property
    def elastic_rotation(self) -> tuple[float, float]:
        """Elastic stiffness of the rotation (N m/rad), and the moment at which it yields (N m)."""
        return self.turning, self.bending

    def energy(self, motion: Any, state: State) -> Values:
        """Return the elastic energy; J."""
        x, y, angle = motion
        elastic = self.along * (x - state.stretch) ** 2 + self.across * y**2
        return (elastic + self.turning * (angle - state.rotation) ** 2) / 2

    def increments(self, motion: Any, rate: Any, state: State, dt: Values) -> Mapping[str, Values]:
        """Return the increments of the plastic motions: projection on the yield surface.

        The flow γ satisfies n²/(1 + a γ)² + m - b γ = 1 with the trial forces n and m.  The left
        side is convex and falls, so Newton's method from a lower bound increases to the solution.
        """
        elastic = motion[0] - state.stretch, motion[2] - state.rotation
        n = self.along * absolute(elastic[0]) / self.axial
        m = self.turning * absolute(elastic[1]) / self.bending
        a, b = 2 * self.along / self.axial**2, self.turning / self.bending**2
        m = larger(m, b * (n - 1) / a)  # for smaller moments the projection is the corner
        flow = positive(larger((n - 1) / a, (m - 1) / b))
        for _ in range(ITERATIONS):
            ratio = n / (1 + a * flow)
            excess = ratio**2 + m - b * flow - 1
            flow = flow + excess / (2 * a * ratio**2 / (1 + a * flow) + b)
        yields, new = below(1.0, n**2 + m), (n / (1 + a * flow), m - b * flow)
        return {
            name: where(yields, sign(e) * (absolute(e) - size * limit / stiffness), 0.0)
            for name, e, size, limit, stiffness in zip(
                self.variables, elastic, new, (self.axial, self.bending),
                (self.along, self.turning), strict=True,
            )
        }  # fmt: skip
