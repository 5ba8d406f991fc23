# SPDX-License-Identifier: MIT
"""Each effect of the package has stored numbers of scenes in which it acts, and a closed form."""

import inspect
import sys
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


INDEPENDENT = {
    "unit/test_axial_bending_hinge.py": {
        "axial_bending_hinge": "test_the_plastic_moment_depends_on_the_axial_force",
    },
    "unit/test_bushings.py": {
        "bushing": "test_on_a_line_it_is_a_stop",
        "clearance": "test_on_a_line_it_is_a_stop",
        "rough_clearance": "test_a_turning_pin_climbs_to_the_friction_angle",
    },
    "unit/test_connector_laws.py": {
        "stop": "test_a_damped_stop_takes_a_part_of_the_velocity",
        "own_connector_law": "test_modes_about_a_state",
        "own_connector_law_with_state": "test_a_maxwell_element_relaxes",
    },
    "unit/test_controllers.py": {
        "controller": "test_a_sample_time_is_independent_of_the_step",
    },
    "unit/test_distributions.py": {
        "normal": "test_samples_have_the_distribution",
        "truncated_normal": "test_samples_have_the_distribution",
        "lognormal": "test_samples_have_the_distribution",
        "weibull": "test_scale_of_weibull",
    },
    "unit/test_fibre_laws.py": {
        "menegotto_pinto": "test_menegotto_pinto_over_random_paths",
        "kent_park": "test_concrete_over_random_paths",
        "mander": "test_concrete_over_random_paths",
    },
    "unit/test_fibres.py": {
        "fibres": "test_plastic_moment_of_a_rectangle",
        "placed_fibres": "test_plastic_moment_of_few_fibres",
    },
    "unit/test_force_diagrams.py": {
        "pinned": "test_simply_supported_beam",
    },
    "unit/test_force_laws.py": {
        "force_law": "test_vibration_of_a_steep_law",
        "force_law_with_state": "test_a_history_against_its_closed_form",
    },
    "unit/test_ground_motion.py": {
        "ground_motion": "test_the_integrals_are_exact",
    },
    "unit/test_hinge_laws.py": {
        "ibarra_krawinkler": "test_one_excursion_by_hand",
        "pinching_hinge": "test_two_pinched_excursions_by_hand",
    },
    "unit/test_hysteresis_laws.py": {
        "ramberg_osgood": "test_a_ramberg_osgood_law_follows_its_power",
        "armstrong_frederick": "test_armstrong_frederick_hardens_exponentially",
        "bouc_wen": "test_bouc_wen_against_integration",
    },
    "unit/test_impacts.py": {
        "impact": "test_a_clutch_that_closes_loses_the_energy_of_the_relative_speed",
    },
    "unit/test_imposed_strains.py": {
        "imposed_strain": "test_heat_bends_a_free_beam_and_loads_a_clamped_one",
    },
    "unit/test_initial_state.py": {
        "point_mass": "test_velocity_gives_kinetic_energy_and_momentum",
        "velocity": "test_velocity_about_a_point",
    },
    "unit/test_interaction_laws.py": {
        "axial_bending": "test_a_column_under_axial_force",
    },
    "unit/test_joints.py": {
        "revolute": "test_bodies_pinned_to_each_other_away_from_their_centres",
    },
    "unit/test_laws_that_hold.py": {
        "own_connector_law_that_holds": "test_a_slow_pull_slips_by_twice_the_drop",
    },
    "unit/test_loads.py": {
        "point_load": "test_a_reaction_balances_a_point_load",
        "table": "test_table_is_linear_between_and_constant_outside",
    },
    "unit/test_material_laws.py": {
        "duvaut_lions": "test_overstress_relaxes_exponentially",
    },
    "unit/test_names_and_free_lengths.py": {
        "spring": "test_a_spring_pulls_a_mass_to_its_free_length",
    },
    "unit/test_settlements.py": {
        "clamped": "test_a_clamp_settles",
        "prescribed_displacement": "test_an_inclined_roller_settles",
    },
    "unit/test_softening_laws.py": {
        "rigid_then_softening": "test_moment_is_the_traction",
        "own_softening_in_cells": "test_moment_is_the_traction",
        "own_softening_at_a_place": "test_moment_is_the_traction",
    },
    "unit/test_user_laws.py": {
        "own_material_law": "test_curvature_of_ramberg_and_osgood",
    },
    "verification/test_actions.py": {
        "pressure": "test_ring_under_pressure",
        "moving_load": "test_moving_mass",
    },
    "verification/test_adaptive.py": {
        "adaptive": "test_the_estimate_is_the_error_of_a_step",
    },
    "verification/test_bifurcations.py": {
        "load_control": "test_a_ring_under_pressure",
        "arc_length": "test_a_ring_under_pressure",
    },
    "verification/test_damping.py": {
        "kelvin_voigt": "test_kelvin_voigt_in_statics_is_retarded",
    },
    "verification/test_degree.py": {
        "section": "test_one_cell_does_not_lock",
        "mesh_of_degree_2": "test_one_cell_does_not_lock",
        "mesh_of_degree_3": "test_one_cell_does_not_lock",
        "refined_mesh": "test_half_circle",
        "lumped_mass": "test_lumped_mass_of_a_rod",
    },
    "verification/test_effects_in_closed_form.py": {
        "axial_and_shear": "test_a_beam_that_yields_in_shear",
        "energy_momentum": "test_midpoint_rules_with_weights",
        "fourth_order": "test_phase_of_the_scheme_of_fourth_order",
        "own_scheme": "test_midpoint_rules_with_weights",
    },
    "verification/test_frequencies.py": {
        "rotating_frame": "test_foucaults_pendulum",
        "rigid": "test_a_slender_portal_that_sways",
        "prismatic": "test_mass_on_a_turning_rail",
        "guided": "test_a_bead_in_a_bowl",
        "spline": "test_a_bead_in_a_bowl",
    },
    "verification/test_friction.py": {
        "coulomb": "test_amplitudes_fall_by_4R_k_each_period",
        "coulomb_in_a_joint": "test_bearing",
    },
    "verification/test_hinge.py": {
        "softening_in_cells": "test_tip_load",
        "linear_softening_in_cells": "test_tip_load",
    },
    "verification/test_linkages.py": {
        "link": "test_a_trammel_does_not_leap",
    },
    "verification/test_machines.py": {
        "release": "test_release_of_the_shear_force",
        "turn": "test_spring_at_large_turns",
        "stretch": "test_frequency_of_a_spring",
        "slide": "test_frequency_of_a_spring",
        "prescribed_motion": "test_motor_bears_the_inertia",
        "prescribed_force": "test_given_moment",
        "yielding_spring": "test_loop_of_a_bilinear_spring",
        "breaking_spring": "test_breaking_spring",
        "damper": "test_damper",
        "body": "test_free_fall",
    },
    "verification/test_mattiasson_1981.py": {
        "static": "test_elastica",
    },
    "verification/test_paths.py": {
        "displacement_control": "test_branch_to_the_elastica",
        "dissipation_control": "test_hinge_snap_back",
    },
    "verification/test_plastic_hinges.py": {
        "rigid_plastic": "test_a_block_that_slips",
        "softening_at_a_place": "test_moment_of_a_hinge",
        "linear_softening_at_a_place": "test_moment_of_a_hinge",
        "hardening_at_a_place": "test_kinematic_hardening_remembers_its_direction",
    },
    "verification/test_rigid_links.py": {
        "rigid_link": "test_moment_is_force_times_offset",
    },
    "verification/test_schemes.py": {
        "energy_momentum_decaying": "test_amplification_of_a_mode",
        "energy_momentum_printed": "test_printed_midpoint_drifts_in_energy_and_keeps_momenta",
        "newmark": "test_amplification_of_a_mode",
        "generalized_alpha": "test_amplification_of_a_mode",
    },
    "verification/test_static_loads.py": {
        "follower_load": "test_follower_force_at_the_end",
        "line_load": "test_line_load_on_a_cantilever",
        "gravity": "test_gravity_on_a_cantilever",
        "roller": "test_roller_at_an_angle",
        "curved_axis": "test_quarter_circle",
    },
    "verification/test_table_1.py": {
        "elasto_plastic": "test_rate_independent",
        "perzyna": "test_viscous",
        "energy_momentum_static": "test_exact_statics",
    },
    "verification/test_tangent_damping.py": {
        "rayleigh": "test_a_yielding_oscillator_converges_with_first_order",
    },
    "unit/test_statements_of_users.py": {
        "own_statement": "test_a_maxwell_element_relaxes",
    },
    "verification/test_wind_soil_magnets.py": {
        "virtual_work": "test_a_current_in_a_field",
        "potential": "test_beam_on_an_elastic_foundation",
    },
}  # fmt: skip
"""Tests of effects by closed forms or calculations that do not use the package, by file."""

WITHOUT: set[str] = set()
"""Effects without such a test; the set must not grow."""


FOLDERS = "model.", "mechanics.", "simulation.step_lengths", "analysis.path_controls"
LAWS = "concrete_laws", "steel_laws", "hinge_laws", "hysteresis_laws", "ground_motion"
MODULES = *FOLDERS, *(f"structures.{name}" for name in LAWS)


def public_effects():
    """Public classes of models, schemes, steps and path controls, by name."""
    return {
        name: kind
        for name, kind in helpers.PUBLIC.items()
        if inspect.isclass(kind)
        and kind.__module__.startswith(tuple(f"ufl_beam.{module}" for module in MODULES))
        and name not in OTHERS
    }


PUBLIC = public_effects()


def test_effects_of_the_unions_are_public():
    """A guide is the law of the joint `Guided`."""
    assert {*LOADS, *Damping.__args__, *Law.__args__} - {Guide} <= set(PUBLIC.values())


def effect_of(record):
    """The class of a record, of a user's class its public base, or None."""
    bases = [kind for kind in type(record).__mro__ if kind in PUBLIC.values()]
    return bases[0] if bases else None


def records_in(value, seen=None):
    """All records in a value, also those of other records and of functions of time."""
    seen = {} if seen is None else seen
    if id(value) in seen:
        return seen
    if is_dataclass(value) and not isinstance(value, type):
        seen[id(value)] = value
        for field in fields(value):
            records_in(getattr(value, field.name), seen)
    elif isinstance(value, (list, tuple)):
        for one in value:
            records_in(one, seen)
    elif isinstance(value, dict):
        records_in(list(value.values()), seen)
    elif inspect.ismethod(value):
        records_in(value.__self__, seen)
    return seen


@cache
def records_of(name):
    """Records of each of the scenes of an effect."""
    drafts = [EFFECTS[name].draft(seed) for seed in range(SCENES)]
    return [list(records_in(list(vars(draft).values())).values()) for draft in drafts]


@pytest.mark.parametrize("name", PUBLIC)
def test_each_effect_acts_in_three_scenes(name):
    """It is in the scene, and the results differ from those with another number of it."""
    own = [one for one in EFFECTS.values() if PUBLIC[name] in one.kinds]
    scenes = [
        (one.name, seed)
        for one in own
        for seed, scene in enumerate(stored(one.name))
        if max(scene["acts"]) > ACTS
        and any(
            effect_of(record) is PUBLIC[name] or type(record).__mro__[1:].count(PUBLIC[name])
            for record in records_of(one.name)[seed]
        )
    ]
    assert len(scenes) >= 3


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
    values = {}
    for name in EFFECTS:
        for record in (one for scene in records_of(name) for one in scene):
            for kind in type(record).__mro__:
                if kind in PUBLIC.values():
                    for field in fields(record):
                        key = kind.__name__, field.name
                        values.setdefault(key, []).append(getattr(record, field.name))
    return values


def options():
    """Fields with a default, and switches, of all effects."""
    for name, kind in PUBLIC.items():
        for field in fields(kind) if is_dataclass(kind) else ():
            default = field.default if field.default_factory is MISSING else field.default_factory()
            switch = any(
                isinstance(x, bool) for x in values_of_fields().get((name, field.name), ())
            )
            if field.init and field.name not in NAMES and (switch or default is not MISSING):
                yield name, field.name, default


@pytest.mark.parametrize(("name", "option", "default"), options())
def test_each_option_is_in_a_scene(name, option, default):
    """With another value than its default; of a switch without default both values."""
    values = values_of_fields().get((name, option), [])
    if default is MISSING:
        assert {True, False} <= set(values)
    else:
        assert any(not _same(value, default) for value in values)


def _same(value, default):
    return type(value) is type(default) and value == default


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_each_degree_is_in_three_scenes(degree):
    meshes = [
        record
        for name in EFFECTS
        for scene in records_of(name)
        for record in scene
        if isinstance(record, ub.Mesh) and record.degree == degree
    ]
    assert len(meshes) >= 3


def test_files_belong_to_effects_and_are_small():
    files = list(FOLDER.iterdir())
    assert {file.stem for file in files} == set(EFFECTS)
    assert sum(file.stat().st_size for file in files) < 2e6


def test_each_effect_has_an_independent_test():
    named = [name for tests in INDEPENDENT.values() for name in tests]
    assert sorted([*named, *WITHOUT]) == sorted(EFFECTS)


@pytest.mark.parametrize("file", INDEPENDENT)
def test_independent_tests_exist(file):
    """They are in the file, which uses a class of the effect, maybe by a scene of `scenes.py`."""
    text = (TESTS / file).read_text("utf-8")
    scenes = (TESTS / "scenes.py").read_text("utf-8") if "from scenes import" in text else ""
    for name, test in INDEPENDENT[file].items():
        assert f"def {test}(" in text
        records = [one for scene in records_of(name) for one in scene]
        own = {type(one) for one in records if isinstance(one, EFFECTS[name].kinds)}
        assert any(kind.__name__ in text + scenes for kind in own.union(EFFECTS[name].kinds))
