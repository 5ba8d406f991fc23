# SPDX-License-Identifier: MIT
"""Each effect of the package has stored numbers of scenes in which it acts, and a closed form."""

import inspect
import sys
from collections import defaultdict
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from pathlib import Path

import helpers
import pytest

import ufl_beam as ub
from ufl_beam.model.connector_laws import Guide, Law
from ufl_beam.model.loads import LOADS, Damping

TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(TESTS / "properties"), str(TESTS)]

import stored_effects  # noqa: E402, F401 - adds the effects
from stored_scenes import EFFECTS, FOLDER, SCENES, stored  # noqa: E402
from test_stored_numbers import TOLERANCE  # noqa: E402

ACTS = 1000 * TOLERANCE
"""Least change of the results by a number of an effect, far above what the comparison lets pass."""

OTHERS = {
    "Connector", "Joint", "Support",  # bases, from which users cannot derive
    "DynamicScheme", "Scheme", "Coefficients", "Step",  # parts of a scheme of a user
    "Scene", "Shape",  # what other records are made of
}  # fmt: skip
"""Public classes of the model and of time schemes that are no effects."""

NAMES = {"name", "depth", "shape"}
"""Fields that are for messages, pictures and section tables."""

IN_SPACE = {
    "Spherical", "Universal", "Cylindrical", "Beam.up", "Revolute.axis", "Turn.axis",
    "Section.centroid_only", "PrescribedDisplacement.axis", "PrescribedDisplacement.up",
    "PrescribedDisplacement.w", "Section.shear3", "Section.twisting",
    "Section.bending2",
}  # fmt: skip
"""Effects and options of scenes in space; the stored scenes are in the plane."""


INDEPENDENT = """
unit/test_axial_bending_hinge.test_the_plastic_moment_depends_on_the_axial_force:
    axial_bending_hinge
unit/test_bushings.test_on_a_line_it_is_a_stop: bushing clearance
unit/test_bushings.test_a_turning_pin_climbs_to_the_friction_angle: rough_clearance
unit/test_connector_laws.test_a_damped_stop_takes_a_part_of_the_velocity: stop
unit/test_connector_laws.test_modes_about_a_state: own_connector_law
unit/test_connector_laws.test_a_maxwell_element_relaxes: own_connector_law_with_state
unit/test_controllers.test_a_sample_time_is_independent_of_the_step: controller
unit/test_distributions.test_samples_have_the_distribution: normal truncated_normal lognormal
unit/test_distributions.test_scale_of_weibull: weibull
unit/test_fibre_laws.test_menegotto_pinto_over_random_paths: menegotto_pinto
unit/test_fibre_laws.test_concrete_over_random_paths: kent_park mander
unit/test_fibres.test_plastic_moment_of_a_rectangle: fibres
unit/test_fibres.test_plastic_moment_of_few_fibres: placed_fibres
unit/test_force_diagrams.test_simply_supported_beam: pinned
unit/test_force_laws.test_vibration_of_a_steep_law: force_law
unit/test_force_laws.test_a_history_against_its_closed_form: force_law_with_state
unit/test_ground_motion.test_the_integrals_are_exact: ground_motion
unit/test_hinge_laws.test_one_excursion_by_hand: ibarra_krawinkler
unit/test_hinge_laws.test_two_pinched_excursions_by_hand: pinching_hinge
unit/test_hysteresis_laws.test_a_ramberg_osgood_law_follows_its_power: ramberg_osgood
unit/test_hysteresis_laws.test_armstrong_frederick_hardens_exponentially: armstrong_frederick
unit/test_hysteresis_laws.test_bouc_wen_against_integration: bouc_wen
unit/test_impacts.test_a_clutch_that_closes_loses_the_energy_of_the_relative_speed: impact
unit/test_imposed_strains.test_heat_bends_a_free_beam_and_loads_a_clamped_one: imposed_strain
unit/test_initial_state.test_velocity_gives_kinetic_energy_and_momentum: point_mass
unit/test_initial_state.test_velocity_about_a_point: velocity
unit/test_interaction_laws.test_a_column_under_axial_force: axial_bending
unit/test_joints.test_bodies_pinned_to_each_other_away_from_their_centres: revolute
unit/test_laws_that_hold.test_a_slow_pull_slips_by_twice_the_drop: own_connector_law_that_holds
unit/test_loads.test_a_reaction_balances_a_point_load: point_load
unit/test_loads.test_table_is_linear_between_and_constant_outside: table
unit/test_material_laws.test_overstress_relaxes_exponentially: duvaut_lions
unit/test_names_and_free_lengths.test_a_spring_pulls_a_mass_to_its_free_length: spring
unit/test_settlements.test_a_clamp_settles: clamped
unit/test_settlements.test_an_inclined_roller_settles: prescribed_displacement
unit/test_softening_laws.test_moment_is_the_traction: rigid_then_softening own_softening_in_cells
    own_softening_at_a_place
unit/test_user_laws.test_curvature_of_ramberg_and_osgood: own_material_law
verification/test_actions.test_ring_under_pressure: pressure
verification/test_actions.test_moving_mass: moving_load
verification/test_adaptive.test_the_estimate_is_the_error_of_a_step: adaptive
verification/test_bifurcations.test_a_ring_under_pressure: load_control arc_length
verification/test_damping.test_kelvin_voigt_in_statics_is_retarded: kelvin_voigt
verification/test_degree.test_one_cell_does_not_lock: section mesh_of_degree_2 mesh_of_degree_3
verification/test_degree.test_half_circle: refined_mesh
verification/test_degree.test_lumped_mass_of_a_rod: lumped_mass
verification/test_effects_in_closed_form.test_a_beam_that_yields_in_shear: axial_and_shear
verification/test_effects_in_closed_form.test_midpoint_rules_with_weights: energy_momentum
    own_scheme
verification/test_effects_in_closed_form.test_phase_of_the_scheme_of_fourth_order: fourth_order
verification/test_mattiasson_1981.test_elastica: static
verification/test_frequencies.test_foucaults_pendulum: rotating_frame
verification/test_frequencies.test_a_slender_portal_that_sways: rigid
verification/test_frequencies.test_mass_on_a_turning_rail: prismatic
verification/test_frequencies.test_a_bead_in_a_bowl: guided spline
verification/test_friction.test_amplitudes_fall_by_4R_k_each_period: coulomb
verification/test_friction.test_bearing: coulomb_in_a_joint
verification/test_hinge.test_tip_load: softening_in_cells linear_softening_in_cells
verification/test_linkages.test_a_trammel_does_not_leap: link
verification/test_machines.test_release_of_the_shear_force: release
verification/test_machines.test_spring_at_large_turns: turn
verification/test_machines.test_frequency_of_a_spring: stretch slide
verification/test_machines.test_motor_bears_the_inertia: prescribed_motion
verification/test_machines.test_given_moment: prescribed_force
verification/test_machines.test_loop_of_a_bilinear_spring: yielding_spring
verification/test_machines.test_breaking_spring: breaking_spring
verification/test_machines.test_damper: damper
verification/test_machines.test_free_fall: body
verification/test_paths.test_branch_to_the_elastica: displacement_control
verification/test_paths.test_hinge_snap_back: dissipation_control
verification/test_plastic_hinges.test_a_block_that_slips: rigid_plastic
verification/test_plastic_hinges.test_moment_of_a_hinge: softening_at_a_place
    linear_softening_at_a_place
verification/test_plastic_hinges.test_kinematic_hardening_remembers_its_direction:
    hardening_at_a_place
verification/test_rigid_links.test_moment_is_force_times_offset: rigid_link
verification/test_schemes.test_amplification_of_a_mode: energy_momentum_decaying newmark
    generalized_alpha
verification/test_schemes.test_printed_midpoint_drifts_in_energy_and_keeps_momenta:
    energy_momentum_printed
verification/test_static_loads.test_follower_force_at_the_end: follower_load
verification/test_static_loads.test_line_load_on_a_cantilever: line_load
verification/test_static_loads.test_gravity_on_a_cantilever: gravity
verification/test_static_loads.test_roller_at_an_angle: roller
verification/test_static_loads.test_quarter_circle: curved_axis
verification/test_table_1.test_rate_independent: elasto_plastic
verification/test_table_1.test_viscous: perzyna
verification/test_table_1.test_exact_statics: energy_momentum_static
verification/test_tangent_damping.test_a_yielding_oscillator_converges_with_first_order: rayleigh
unit/test_statements_of_users.test_a_maxwell_element_relaxes: own_statement
verification/test_wind_soil_magnets.test_a_current_in_a_field: virtual_work
verification/test_wind_soil_magnets.test_beam_on_an_elastic_foundation: potential
"""
"""Tests of effects by closed forms or calculations that do not use the package: test, effects."""

TESTS_OF: dict[str, list[str]] = {}
for word in INDEPENDENT.split():
    if word.endswith(":"):
        TESTS_OF[word[:-1]] = []
    else:
        [*TESTS_OF.values()][-1].append(word)

WITHOUT: set[str] = set()
"""Effects without such a test; the set must not grow."""

MODULES = (
    "model.", "mechanics.", "simulation.step_lengths", "analysis.path_controls",
    "structures.concrete_laws", "structures.hinge_laws",
    "structures.hysteresis_laws", "structures.ground_motion",
)  # fmt: skip

PUBLIC = {
    name: kind
    for name, kind in helpers.PUBLIC.items()
    if inspect.isclass(kind)
    and kind.__module__.removeprefix("ufl_beam.").startswith(MODULES)
    and name not in OTHERS | IN_SPACE
}
"""Public classes of models, schemes, steps and path controls, by name."""


def test_effects_of_the_unions_are_public():
    """A guide is the law of the joint `Guided`."""
    assert {*LOADS, *Damping.__args__, *Law.__args__} - {Guide} <= set(PUBLIC.values())


def records_in(value, seen=None):
    """All records in a value, also those of other records and of functions of time."""
    seen = {} if seen is None else seen
    if id(value) in seen:
        return seen
    parts = ()
    if is_dataclass(value) and not isinstance(value, type):
        seen[id(value)] = value
        parts = [getattr(value, field.name) for field in fields(value)]
    elif isinstance(value, (list, tuple, dict)):
        parts = list(value.values()) if isinstance(value, dict) else value
    elif inspect.ismethod(value):
        parts = [value.__self__]
    for part in parts:
        records_in(part, seen)
    return seen


@cache
def records_of(name):
    """Records of each of the scenes of an effect."""
    drafts = [EFFECTS[name].draft(seed) for seed in range(SCENES)]
    return [list(records_in(list(vars(draft).values())).values()) for draft in drafts]


@pytest.mark.parametrize("name", PUBLIC)
def test_each_effect_acts_in_three_scenes(name):
    """It is in the scene, and the results differ from those with another number of it."""
    own = [one.name for one in EFFECTS.values() if PUBLIC[name] in one.kinds]
    scenes = [(one, seed, scene) for one in own for seed, scene in enumerate(stored(one))]
    acting = [
        any(isinstance(record, PUBLIC[name]) for record in records_of(one)[seed])
        for one, seed, scene in scenes
        if max(scene["acts"]) > ACTS
    ]
    assert sum(acting) >= 3


@pytest.mark.parametrize("name", EFFECTS)
def test_each_number_of_an_effect_acts(name):
    """In one of the scenes, and in each scene at least one number."""
    acts = [scene["acts"] for scene in stored(name)]
    assert all(max(numbers) > ACTS for numbers in acts)
    most = max(len(numbers) for numbers in acts)
    idle = [k for k in range(most) if max(row[k] for row in acts if len(row) > k) <= ACTS]
    assert not idle


@cache
def values_of_fields():
    """Values of each field of each effect in all scenes, by class and name."""
    values = defaultdict(list)
    for record in (one for name in EFFECTS for scene in records_of(name) for one in scene):
        for kind in type(record).__mro__:
            for field in fields(record) if kind in PUBLIC.values() else ():
                values[kind.__name__, field.name].append(getattr(record, field.name))
    return values


def options():
    """Fields with a default, and switches, of all effects."""
    for name, kind in PUBLIC.items():
        for field in fields(kind) if is_dataclass(kind) else ():
            default = field.default if field.default_factory is MISSING else field.default_factory()
            switch = any(isinstance(x, bool) for x in values_of_fields()[name, field.name])
            if {field.name, f"{name}.{field.name}"} & (NAMES | IN_SPACE) or not field.init:
                continue
            if switch or default is not MISSING:
                yield name, field.name, default


@pytest.mark.parametrize(("name", "option", "default"), [*options()])
def test_each_option_is_in_a_scene(name, option, default):
    """With another value than its default; of a switch without default both values."""
    values = values_of_fields()[name, option]
    if default is MISSING:
        assert {True, False} <= set(values)
    else:
        assert any(type(x) is not type(default) or x != default for x in values)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_each_degree_is_in_three_scenes(degree):
    records = [record for name in EFFECTS for scene in records_of(name) for record in scene]
    assert sum(isinstance(x, ub.Mesh) and x.degree == degree for x in records) >= 3


def test_files_belong_to_effects_and_are_small():
    files = list(FOLDER.iterdir())
    assert {file.stem for file in files} == set(EFFECTS)
    assert sum(file.stat().st_size for file in files) < 2e6


def test_each_effect_has_an_independent_test():
    named = [name for names in TESTS_OF.values() for name in names]
    assert sorted([*named, *WITHOUT]) == sorted(EFFECTS)


@pytest.mark.parametrize("place", TESTS_OF)
def test_independent_tests_exist(place):
    """They are in the file, which uses a class of the effect, maybe by a scene of `scenes.py`."""
    file, _, test = place.partition(".")
    text = (TESTS / f"{file}.py").read_text("utf-8")
    scenes = (TESTS / "scenes.py").read_text("utf-8") if "from scenes import" in text else ""
    assert f"def {test}(" in text
    for name in TESTS_OF[place]:
        records = [one for scene in records_of(name) for one in scene]
        own = {type(one) for one in records if isinstance(one, EFFECTS[name].kinds)}
        assert any(kind.__name__ in text + scenes for kind in own.union(EFFECTS[name].kinds))
