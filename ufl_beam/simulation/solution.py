# SPDX-License-Identifier: MIT
"""Solutions: stored states of a run, their files and summary, and cells with open hinges."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ufl_beam.arrays import Array
from ufl_beam.discretization.dof_numbering import DofNumbering
from ufl_beam.discretization.state_io import OtherVersion, State
from ufl_beam.display import TIME, Rich, counted
from ufl_beam.errors import ArgumentError, Moved, require_kind, warn
from ufl_beam.file_system import require_path
from ufl_beam.mechanics.time_scheme import Scheme
from ufl_beam.model.bodies import AttachmentPoint, Member, Place
from ufl_beam.model.connector_law import ForceLaw
from ufl_beam.model.connector_laws import Controller, Guide
from ufl_beam.model.fibres import SectionPoints
from ufl_beam.model.functions import Table
from ufl_beam.model.imposed_strains import ImposedStrain
from ufl_beam.model.joints import Guided
from ufl_beam.model.loads import LoadAlongBeam, profile_at
from ufl_beam.model.scene import Scene
from ufl_beam.output.internal_variables import in_beam
from ufl_beam.output.output_files import (
    Content,
    WrongReader,
    add_prefix,
    decoding,
    remove_prefix,
    require_arrays,
    version,
    write,
)
from ufl_beam.output.serialization import (
    SAMPLES,
    Description,
    SavedCurve,
    SavedFunction,
    add_new_fields,
    difference,
    from_data,
    function_name,
    require_no_code,
    to_data,
)
from ufl_beam.output.state_rows import HINGE, JUMP
from ufl_beam.output.states import NO_STATE, States
from ufl_beam.parallel import active_comm, on_first

UNKNOWN = -2
"""Value of ``substeps_of_last`` if the next step does not begin at the last stored state."""


class Solution(States, Rich):
    """Results of a run: motions and forces at the stored times; the same on every process.

    A solution can be saved, see :meth:`save`, and pickled with the same content.

    Attributes:
        scene: Model.
        numbering: Vertices, cells and degrees of freedom of the scene.
        substeps: Number of substeps; an undivided step counts as one substep.
        iterations: Number of Newton iterations.
        time_error: Sum of the estimated errors of all steps, or in scenes that may slide, touch,
            yield or break, the largest estimated error so far, see :class:`Adaptive`; NaN with
            equal steps.
        seconds: Wall time of the run with the setup of the simulation; s.
        building: Wall time of the setup in :func:`simulate`, which is not saved; s.
        every: Number of steps between stored states.
        parameter: Labels and formats of :attr:`times`, which are load factors in a path.
        imbalance_message: Message if the imbalance of the energy ledger exceeds the tolerance of
            the scheme; empty otherwise.
        warnings: Warnings of the run, one in each line; see docs/warnings.md.
        version: Version of the package that computed the solution.
        internal: Data for a run that continues at the end of this run: internal variables of cells
            and connectors, reactions, rates and forces.
        scheme: Time scheme of the run; None if the solution was loaded or unpickled.
        substeps_of_last: Number of substeps up to the last stored state; :data:`UNKNOWN` if the
            next step does not begin there.

    Example:
        >>> print((1e3 * solution.displacement(beam.end)[-1]).round(1))  # mm, mm, mrad, at t = 1 s
        [ -0.1 -18.9 -14.3]
        >>> print(solution.section_forces(beam)[:, 2].round(-3))  # M in the cells; N m
        [-171000. -122000.  -73000.  -24000.]
        >>> print(solution.reaction(scene.supports[0])[-1, 1:].round(-4))  # N, N m
        [100000. 200000.]
    """

    parameter = TIME

    def __init__(self, scene: Scene, numbering: DofNumbering, like: States | None = None) -> None:
        super().__init__(numbering, like)
        self.scene = scene
        self.substeps = self.iterations = 0
        self.time_error, self.seconds, self.building = math.nan, 0.0, 0.0
        self.every, self.imbalance_message, self.warnings = 1, "", ""
        self.version = version()
        self.internal: State = {}
        self.scheme: Scheme | None = like.scheme if isinstance(like, Solution) else None
        self.substeps_of_last = UNKNOWN

    def count(self, substeps: int, iterations: int) -> None:
        """Store the numbers of substeps and iterations up to the last state, which is a new one."""
        self.substeps, self.iterations, self.substeps_of_last = substeps, iterations, substeps
        self.internal = {}

    def downsample(self) -> None:
        """Delete every other state; the first state stays."""
        self.substeps_of_last = self.substeps_of_last if len(self) % 2 else UNKNOWN
        super().downsample()

    def history(self) -> State:
        """Return all states as arrays by name, such as "q"."""
        return {**super().history(), "every": np.array([self.every])}

    def resume(self, history: State) -> None:
        """Restore the states of another run, see :meth:`history`."""
        super().resume(history)
        self.every, self.substeps_of_last = int(history["every"][0]), UNKNOWN

    # -- files ---------------------------------------------------------------------------------

    def save(self, path: str | Path) -> None:
        """Write the solution to a file for :meth:`load`; all processes call it together.

        The file has all results and the numbers of the scene, but no code: functions of time are
        saved as values at the stored times, curves as points, other functions by their names, and
        user laws by their names and numbers.  An existing file is replaced when the new file is
        complete.

        Raises:
            ArgumentError: The file cannot be written, or an object of the scene is no dataclass.
            OSError: The disk is full.
        """
        file = require_path(path, "save")
        on_first(active_comm(), lambda: write(file, FORMAT, self._content()))

    @classmethod
    def load(cls, path: str | Path, *, scene: Scene | None = None) -> Solution:
        """Read a solution that :meth:`save` wrote.

        Places belong to the loaded scene: ``loaded.displacement(loaded.scene["left"].end)``.

        Args:
            path: File.
            scene: Scene of the run, built anew by its script.  It supplies the functions and user
                laws, which files do not contain.  All its numbers, classes and names must agree
                with the file, and its functions of time must have the same values.

        Raises:
            ArgumentError: The file is missing, damaged, no solution, or of another scene; a version
                with another numbering of degrees of freedom wrote it; or it has user laws, and no
                scene is given.

        Example:
            >>> solution.save("beam.h5")
            >>> loaded = ub.Solution.load("beam.h5")
            >>> bool((loaded.q == solution.q).all())
            True
        """
        file = require_path(path, "Solution.load")
        if scene is not None:
            require_kind(scene, Scene, "Solution.load: scene")
        with decoding(file, FORMAT) as content:
            return restored(content, scene)

    def _content(self) -> Content:
        numbering = self.numbering

        def record(owner: Any, field: str, function: Any) -> Any:
            """Return a record to save for a function in a field of ``owner``, or None."""
            if field == "curve" and isinstance(owner, Member):
                grid = (k / SAMPLES for k in range(SAMPLES + 1))
                samples = {*grid, *map(float, numbering.parameters(owner))}
                return SavedCurve.sampled(function_name(function), function, samples)
            if field == "curve":
                return _used_curve(self, owner)
            if isinstance(owner, LoadAlongBeam | ImposedStrain) and field != "amplitude":
                even = np.linspace(*owner.span, SAMPLES + 1)
                s = np.union1d(numbering.gauss_parameters(owner.beam), even)
                s = s[(s >= owner.span[0]) & (s <= owner.span[1])]
                values = profile_at(s, function, owner.span, f"{owner}: {field}")
                return Table(tuple(map(float, s)), tuple(map(float, values)))
            if field in TIME_FUNCTIONS and not isinstance(owner, Controller | ForceLaw):
                return SavedFunction.sampled(function, map(float, self.times))
            return None

        return {
            "kind": type(self).__name__, "scene": to_data(numbering.scene, record),
            "mesh": to_data(numbering.mesh), "numbering": numbering.checksum(),
            **{name: getattr(self, name) for name in NAMED}, **self._arrays(),
        }  # fmt: skip

    def _arrays(self) -> State:
        arrays = add_prefix("history/", self.history()) | add_prefix("internal/", self.internal)
        return {"counts": np.array([self.substeps, self.iterations])} | arrays

    def _set_content(self, content: Content) -> None:
        require_arrays(content, {"counts": (2,), "history/every": (1,)})
        self.resume(remove_prefix("history/", content))
        self.internal = remove_prefix("internal/", content)
        self.substeps, self.iterations = map(int, content["counts"])
        for name, kind in NAMED.items():
            setattr(self, name, kind(content[name]))

    def __reduce__(self) -> tuple[Any, ...]:
        require_no_code((content := self._content())["scene"])
        return restored, (content,)

    @property
    def progress(self) -> Array:
        """Increasing abscissa of the stored states, here the time; (n+1,); s."""
        return self.times

    def acceleration(self, place: AttachmentPoint) -> Array:
        """Return the mean acceleration of a place in each step; (n+1, 3); m/s², m/s², rad/s².

        In space, return it along x, y, z, and about axes of the node; (n+1, 6).

        It is the change of the velocity since the previous stored time, divided by the time between
        both, and is exact to second order in the middle of this interval.  In midpoint schemes
        :meth:`reaction` and section forces of the same row are in equilibrium with it, but not at
        fourth order, where they belong to the last stage of the step.  The first row is NaN.  See
        docs/results.md for values at the stored times, and for moving supports.

        Raises:
            ArgumentError: The run was static, or the beam or body is not in the scene.

        Example:
            >>> a = solution.acceleration(beam.end)[:, 1]
            >>> np.allclose(np.diff(solution.times) @ a[1:], solution.velocity(beam.end)[-1, 1])
            True
        """
        if not len(self.column("v")):
            raise ArgumentError("acceleration: the run was static; there is none")
        change = np.diff(self.velocity(place), axis=0) / np.diff(self.times)[:, None]
        return np.concatenate([np.full_like(change[:1], math.nan), change])

    def variables(self, beam: Member) -> dict[str, Array]:
        """Return the internal variables of a beam at the end of the run, by the names of its laws.

        Each array has the axes cells, Gauss points of a cell, and points of the section.  These are
        the fibres in the order of ``beam.section.fibres.y``, or the resultants that have a law, in
        the order N, V, M; a law of several resultants has one point.  If the law at a point has no
        variable of this name, the value is NaN.

        Raises:
            ArgumentError: The beam is not in the scene, or its laws have no internal variables.
        """
        return in_beam(self.numbering, self.internal, beam)

    storeys = Moved("ufl_beam.structures.storeys(solution, levels)")
    hinges = Moved("ufl_beam.structures.hinge_table(solution, limits)")

    def hinge_place_error(self) -> dict[Member, float]:
        """Return the largest relative error of the hinge limit, by beam with open embedded hinges.

        A hinge of ``Section(hinge=)`` is in the middle of its cell of length h and opens when the
        moment there reaches the limit; at the ends of the cell the moment differs by ``|V| h/2``.
        The error is ``|V| h / (2 limit)``, with V at the last stored time before the opening; if
        this is the initial time, V is taken at the next stored time.  Cells of degree 2 or 3 may
        open at each Gauss point; the first is 0.211 h or 0.113 h from an end, instead of h/2.
        Hinges that were open at the beginning of the run are not included.
        """
        return {hinges.beam: hinges.error for hinges in Opened(self).hinges()}

    def summary(self) -> list[str]:
        """Return lines on the model, the run, and embedded hinges that opened."""
        if not len(self):
            return [str(self.numbering), NO_STATE]
        ends = " to ".join(f"{t:g}" for t in (*self.times[:1], *self.times[-1:]))
        lines = [
            str(self.numbering),
            f"{self.parameter.value.format(ends)} in {self.substeps} steps, "
            f"{self.iterations / max(self.substeps, 1):.2f} Newton iterations each, "
            f"{self.seconds:.2f} s of wall time",
        ]
        if hinges := Opened(self).hinges():
            number, worst = sum(x.number for x in hinges), max(hinges, key=lambda x: x.error)
            lines.append(
                f"embedded hinges opened in {counted((number, 'cell', 'cells'))}; their place "
                f"within the cell shifts the limit by at most {_percent(worst.error)} "
                f"({worst.beam.name}, cell at s = {worst.place.s:.3g})"
            )
        return lines

    def __str__(self) -> str:
        energy = str(self.energy) if len(self) else ""
        said = *self.summary(), energy, self.imbalance_message, self.warnings
        return "\n".join(filter(None, said))

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {'; '.join(self.summary()[:2])}>"


def restored(content: Content, scene: Scene | None = None) -> Solution:
    """Make a solution from the content of a file, with ``scene``, by default the saved scene."""
    described = from_data(content["scene"]) if scene is None else scene
    numbering = DofNumbering(described, from_data(content["mesh"]))
    if numbering.checksum() != content["numbering"]:
        if scene is not None:
            raise WrongReader(
                "it is a solution of another scene: its beams, cells, bodies or joints differ; "
                "give the scene of that run, or load the file without scene="
            )
        raise OtherVersion("it numbers degrees of freedom differently")
    kinds = {kind.__name__: kind for kind in (Solution, *Solution.__subclasses__())}
    solution = kinds[content["kind"]](numbering.scene, numbering)
    solution._set_content(content)
    if scene is not None:
        present = solution._content()["scene"]
        scenes = present, add_new_fields(content["scene"], present)
        now, then = (Description({"scene": json.loads(json.dumps(d))}).texts for d in scenes)
        if differs := difference(now, then):
            raise WrongReader(
                f"it is a solution of another scene: {differs}; give the scene of that run, or "
                "load the file without scene="
            )
    return solution


# -- cells that opened -----------------------------------------------------------------------------
#
# An embedded hinge is in the middle of its cell, and opens when the mean moment of the cell reaches
# the limit.  At the ends the moment differs by |V| h/2, so a hinge there opens at another load.

WARNED_SHIFT = 0.05
"""Largest :meth:`Solution.hinge_place_error` without a warning."""

INCREMENT = 1e-6
"""Increment of the opening in a difference quotient, as a fraction of fracture energy / limit."""


class OpenedHinges(NamedTuple):
    """Embedded hinges of a beam that opened in a run."""

    beam: Member
    number: int  # number of hinges that opened
    error: float  # largest error of their limit, see `Solution.hinge_place_error`
    place: Place  # middle of the cell with the largest error


class Opened:
    """Integration points of cells that opened in a run.

    Attributes:
        first: Index of the first stored time after the opening; 0 if the point was open at the
            beginning, -1 if it stayed closed; (num_cells, degree).
        shear: |V| at the stored time before ``first``, or at ``first`` if that time is the
            beginning of the run; (num_cells, degree); N.
        dissipated: Energy that hinges and cracks dissipated up to the end; (num_cells, degree); J.
        turned: Largest jump of the rotation at stored times; (num_cells, degree); rad.
    """

    def __init__(self, states: States) -> None:
        self._numbering, self._times = states.numbering, states.times
        numbering, p = states.numbering, states.numbering.mesh.degree
        shape = len(numbering.cells), p
        self.first = np.full(shape, -1)
        self.shear, self.dissipated, self.turned = np.zeros((3, *shape))
        if not len(states):
            return
        columns, row = states.row(-1)
        at_end = columns.column_of("material", row)[:, HINGE]
        self.dissipated[numbering.inelastic_cells] = at_end.reshape(-1, p)
        rows = np.flatnonzero(at_end > 0)
        if not len(rows):
            return
        opened = numbering.inelastic_cells[rows // p], rows % p
        dissipated, V, jump = (states.column("material")[:, rows, k] for k in (HINGE, 1, JUMP))
        self.turned[opened] = np.abs(jump).max(axis=0)
        self.first[opened] = first = (dissipated > 0).argmax(axis=0)
        # V is taken before the opening, because a sudden opening causes vibrations.
        n = np.where(first > 1, first - 1, first)
        self.shear[opened] = np.abs(V[n, np.arange(len(rows))])

    def hinges(self) -> list[OpenedHinges]:
        """Return, beam by beam, the hinges of ``Section(hinge=)`` that opened in the run."""
        numbering = self._numbering
        hinges = []
        for beam in numbering.scene.beams:
            law, cells = beam.section.hinge, numbering.cells_of(beam)
            cells = cells[np.any(self.first[cells] > 0, axis=1)]
            if law is None or not len(cells) or law.limit == 0:
                continue
            to_ends = numbering.lengths(cells) * numbering.mesh.points[0]
            errors = self.shear[cells].max(axis=1) * to_ends / law.limit
            worst = int(np.argmax(errors))
            place = numbering.middle(int(cells[worst]))
            hinges.append(OpenedHinges(beam, len(cells), float(errors[worst]), place))
        return hinges

    def warn(self, scheme: Scheme) -> None:
        """Issue a :class:`ModelWarning` for each beam whose results depend on the mesh.

        A warning is issued for a hinge if its resistance falls with the opening faster than the
        moment of its cell can follow, with the stiffness θ EI/h (for a fibre θ E/h).  Another one
        is issued for hinges of ``Section(hinge=)`` whose :meth:`Solution.hinge_place_error`
        exceeds :data:`WARNED_SHIFT`.
        """
        numbering, times = self._numbering, self._times
        middle = numbering.mesh.degree == 1
        for beam in numbering.scene.beams:
            cells, of_section = numbering.cells_of(beam), beam.section.section_points
            falls = (_fall(points, scheme) for points in of_section(beam.section.hinge))
            fall, energy = max(falls, default=(0.0, 0.0))
            opened = (self.first[cells] > 0) & (self.dissipated[cells] >= energy)
            lengths = numbering.section_lengths(cells).reshape(opened.shape)
            ratios = np.where(opened, lengths, 0.0) * fall
            worst, point = divmod(int(np.argmax(ratios)), ratios.shape[1])
            ratio, length = ratios[worst, point], numbering.lengths(cells[[worst]])[0]
            t = times[self.first[cells[worst], point]]
            if ratio > 1:
                warn(
                    f"{beam.name}: the hinge in the cell at "
                    f"s = {numbering.middle(int(cells[worst])).s:.3g} opened suddenly by "
                    f"t = {t:.6g} s: its resistance falls {ratio:.3g} times as fast as its cell of "
                    f"{length:.3g} m can follow. Energy that the cell released and the opening did "
                    "not dissipate went to the rest of the scene. Use cells shorter than "
                    f"{length / ratio:.3g} m, or a fracture energy "
                    f"{ratio:.3g} times as large"
                )
            turned = self.turned[cells].max(axis=1)
            if numbering.scene.in_space and (jump := turned.max()) > math.pi / 2:
                warn(
                    f"{beam.name}: the hinge in the cell at "
                    f"s = {numbering.middle(int(cells[turned.argmax()])).s:.3g} turned "
                    f"by {math.degrees(jump):.3g} degrees. Against torsion, and bending about axis "
                    f"2, its cell is {(jump / 2 / math.sin(jump / 2)) ** 2:.3g} times too stiff "
                    "there. Put the hinge between two nodes, Beam(hinges={s: law})"
                )
        for member, number, error, place in self.hinges():
            if error > WARNED_SHIFT:
                where, at_point = (
                    ("in the middle", "in its middle") if middle else ("at a Gauss point", "there")
                )
                warn(
                    f"{member.name}: the hinge of the section opened in "
                    f"{counted((number, 'cell', 'cells'))}, "
                    f"{where} of a cell. At the ends of the cell at "
                    f"s = {place.s:.3g} the moment differs from the moment {at_point} by "
                    f"{_percent(error)} of the limit, so the load at which the hinge opens has the "
                    "same uncertainty. Put a hinge exactly where it belongs, "
                    "Beam(hinges={s: law}), or use shorter cells"
                )


def _percent(fraction: float) -> str:
    """Return a fraction in per cent: "12 %", or "more than 100 %" if the limit is near zero."""
    return f"{100 * fraction:.2g} %" if fraction <= 1 else "more than 100 %"


def _fall(section_points: SectionPoints, scheme: Scheme) -> tuple[float, float]:
    """Return the steepest softening slope, divided by θ times a stiffness (1/m), and an energy (J).

    The stiffness is the least stiffness of points that can break.  The energy is the least energy
    that a cell dissipates up to the steepest slope.  Both results are zero without softening.
    """
    law = section_points.softening
    if law is None or law.limit == 0:
        return 0.0, 0.0
    growth, begins = INCREMENT * law.fracture_energy / law.limit, np.array([law.steepest[1]])
    after = scheme.resistance(law, begins, np.array([growth]))
    (fall,) = (law.traction(begins) - after) / growth
    breaking = section_points.breaking
    energy = law.mean_traction(0 * begins, begins) * begins * section_points.weights[breaking].min()
    stiffness = scheme.theta * section_points.stiffness[breaking].min()
    return float(fall / stiffness), float(energy[0])


# -- text in the file ------------------------------------------------------------------------------

FORMAT = "solution of ufl_beam, 6"
"""Format of the file; its number is increased by each incompatible change of the format."""

NAMED = {
    "seconds": float, "time_error": float, "equilibrium_fraction": float, "needs_start": bool,
    "imbalance_message": str, "warnings": str, "version": str,
}  # fmt: skip
"""Attributes that a file contains unchanged, and their types."""

TIME_FUNCTIONS = ("amplitude", "position", "u", "v", "psi", "motion", "force", "numbers")
"""Names of fields with functions of time; "force" of controllers and force laws is an exception."""


def _used_curve(solution: Solution, joint: Guided) -> SavedCurve:
    """Sample the part of a guide curve that the motion used, extended at both ends.

    The extension is a tenth of the part plus a hundredth of the scene.
    """
    (holder,), size, used = joint.holders, solution.scene.size, [0.0]
    assert isinstance(holder.law, Guide)
    curve = holder.law.curve
    for point in solution.position(holder.b):
        used.append(curve.nearest(point, used[-1], size))
    first, last = float(np.nanmin(used)), float(np.nanmax(used))
    slopes = [math.hypot(*curve.at(s)[1]) for s in (first, last)]
    more = 0.1 * (last - first) + 0.01 * size / min(slopes)
    step = (last - first + 2 * more) / SAMPLES  # the place of the undeformed scene is a sample
    grid = range(math.floor((first - more) / step), math.ceil((last + more) / step) + 1)
    name, at = function_name(joint.curve), [k * step for k in grid]
    return SavedCurve.sampled(name, lambda s: curve.at(s)[0], at)
