# %% [markdown]
# # Concrete column: a cyclic test and its computation
#
# A cantilever of reinforced concrete under constant compression is bent to both sides with growing
# displacements.  The model has fibres of concrete and steel.  All its parameters are published data
# of the test specimen or formulas of the literature; none is fitted.
#
# This demo shows
#
# * a reinforced section: `Section.rectangle(fibres=cover, core=core)` and `.reinforced(...)`,
# * laws of `Mander` for confined and unconfined concrete and of `MenegottoPinto` for the bars,
# * a history of prescribed displacements, `Table`, beside the measured forces,
# * peak forces, stiffness and dissipated energy compared with the test.
#
# The test is unit 1 of Soesianawati, Park and Priestley, *Limited ductility design of reinforced
# concrete columns*, report 86-10, University of Canterbury, 1986.

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

import ufl_beam as ub
import ufl_beam.structures as st

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## Published data
#
# Dimensions, strengths and the axial force are from the PEER Structural Performance Database
# (specimen 7) and of Taylor et al., NISTIR 5984, 1997, which also normalise the specimen with two
# ends to a cantilever.  The history is the one of the database in example qfem-0034 of quoFEM
# (SimCenter), which omits the first, elastic cycles and the last cycles up to 98 mm.  Of its 548
# points, 144 are below, rounded to 0.1 mm and 1 kN; the loops of all points enclose 108.3 kJ.

# %%
side, length, clear = 0.4, 1.6, 0.013  # m; clear: cover of the hoops
f_c, f_y, f_h = 46.5e6, 446e6, 364e6  # Pa: concrete, bars, hoops
bar, hoop, spacing, volume_ratio = 0.016, 0.007, 0.085, 0.0086  # m, m, m, 1; 12 bars
P = 744e3  # N
measured_energy = 108.3e3  # J

# fmt: off
test = np.array([  # displacement (mm), force (kN)
    (0, 0), (3.1, 93), (7, 147), (13.4, 189), (18.5, 197), (19.4, 179), (17.5, 146), (0.4, -32),
    (-5.7, -117), (-12, -165), (-14.6, -177), (-18.8, -182), (-19.5, -164), (-14.7, -103),
    (5.3, 95), (15.5, 173), (19.5, 191), (15.8, 125), (3.9, 7), (-3.5, -83), (-12.5, -141),
    (-19.2, -168), (-12.4, -76), (4.7, 90), (17.8, 187), (23.2, 197), (26.5, 199), (38.1, 199),
    (38.8, 180), (37.2, 149), (27.4, 60), (19.5, 11), (3.5, -44), (-14.8, -152), (-21, -176),
    (-23.8, -181), (-38.2, -186), (-39.2, -170), (-37.4, -139), (-25.9, -46), (-18.3, -6),
    (-2.1, 47), (9.4, 115), (17.2, 148), (29.4, 178), (38.4, 189), (39.3, 184), (38.4, 161),
    (34.9, 125), (24.8, 41), (18.4, 5), (3.4, -42), (-13.2, -142), (-20.7, -174), (-26.9, -183),
    (-38.4, -184), (-38.9, -159), (-35.6, -122), (-31.5, -84), (-23.1, -29), (-12.3, 15),
    (-1.1, 53), (5.6, 92), (13.2, 125), (26.6, 168), (35.3, 183), (49.7, 193), (58.4, 192),
    (57.3, 156), (45.7, 56), (33.9, 0), (27.4, -20), (3.9, -63), (-13.1, -123), (-29.6, -166),
    (-45.2, -179), (-55.5, -182), (-58.2, -180), (-58.7, -166), (-55.7, -126), (-47.8, -60),
    (-39.1, -15), (-31.3, 9), (-4.1, 64), (15.7, 131), (39.3, 166), (58.3, 183), (56.6, 144),
    (47.9, 70), (40.3, 26), (31.8, -9), (21.4, -32), (6.2, -58), (-11.6, -113), (-28.6, -148),
    (-47.8, -166), (-59.1, -172), (-51.1, -84), (-44.8, -41), (-38.2, -12), (-30, 11), (-20, 34),
    (-9.9, 49), (-3.6, 64), (10.7, 114), (21, 141), (38.8, 168), (46.4, 174), (63.1, 186),
    (77.6, 184), (78.4, 168), (77, 141), (68.5, 74), (56.8, 15), (45.2, -21), (36, -40),
    (19.3, -55), (4, -78), (-30.8, -152), (-38.2, -160), (-57.9, -173), (-63.1, -175),
    (-77.9, -170), (-78.1, -142), (-73.5, -98), (-67.3, -56), (-55.7, -0), (-44.5, 30),
    (-32.2, 48), (-8.9, 72), (16, 127), (27.7, 148), (55.2, 173), (78, 179), (75.9, 130),
    (65.4, 55), (54.2, 5), (41, -32), (35.6, -41), (15.3, -60), (-30.3, -141), (-49.8, -158),
    (-60.4, -162), (-75.7, -163),
])
# fmt: on
u, F = test[:, 0] * 1e-3, test[:, 1] * 1e3  # m, N

# %% [markdown]
# ## Section
#
# The stiffness of the concrete, 5000 √f_c, the strength of the confined core and the efficiency k_e
# of the hoops are from Mander, Priestley and Park (1988), with all bars in corners of hoops.
# The rest are **assumptions** of usual size, made before the computation: strain 0.002 at the
# strength, spalling at 0.006, bars that harden by 1 % of their stiffness, a tensile strength of
# 0.62 √f_c and a fracture energy of 100 J/m².

# %%
E_c, E_s, A = 5000e6 * np.sqrt(f_c / 1e6), 200e9, np.pi / 4 * bar**2  # Pa, Pa, m²
outer = side / 2 - clear - hoop - bar / 2  # m, from the middle to the outer bars
rows, areas = np.array([-1, -1 / 3, 1 / 3, 1]) * outer, np.array([4, 2, 2, 4]) * A  # m, m²
within = side - 2 * clear - hoop  # m, between the axes of the hoops
gap = 2 * outer / 3 - bar  # m, between bars
arching = 1 - 12 * gap**2 / 6 / within**2
k_e = arching * (1 - (spacing - hoop) / 2 / within) ** 2 / (1 - 12 * A / within**2)
tension = ub.Softening(0.62e6 * np.sqrt(f_c / 1e6), fracture_energy=100.0)  # Pa, J/m²
cover = st.Mander(f_c, strain=0.002, spalling=0.006, tension=tension)
core = st.Mander.confined(f_c, k_e * volume_ratio / 2 * f_h, tension=tension)
bars = st.MenegottoPinto(f_y, hardening=0.01)
ub.print_once(f"efficiency of the hoops {k_e:.3f}, confined strength {core.strength / 1e6:.1f} MPa")

section = ub.Section.rectangle(
    b=side, h=side, E=E_c, nu=0.2, fibres=ub.Fibres(cover, number=40),
    core=ub.Fibres(core, number=40), cover=clear + hoop / 2,
).reinforced(rows, areas, E=E_s, fibres=ub.Fibres(bars))  # fmt: skip

# %% [markdown]
# ## Test
#
# The axial force keeps its direction, so that its moment P u (P-Δ) reduces the lateral force.
# Crushing localizes in the lowest cell, which is as long as half of the depth of the section.  With
# 6 to 12 cells the largest force is 201 to 195 kN, and the energy 111 to 112 kJ.

# %%
column = ub.Beam((0, 0), (0, length), section, cells=8, name="column")
weight = ub.PointLoad(column.end, force=(0, -P), amplitude=ub.ramp(1.0))
history = ub.Table(np.arange(len(u) + 1), [0.0, *u])
push = ub.PrescribedDisplacement(column.end, u=history)
foot = ub.Clamped(column.start)
scene = ub.Scene([column], supports=[foot, push], loads=[weight])
run = ub.simulate(scene, ub.Static(), t=(0, len(u)), dt=0.25)
ub.print_once(f"\n{run}")
moved = run.displacement(column.end)  # m
force = run.reaction(push)[:, 0]  # N

# %% [markdown]
# ## Comparison
#
# A half-cycle ends where the displacement turns.  Its largest force is compared.  The measured
# stiffness is the secant to three quarters of the largest force.


# %%
def energy(x, f):
    """Return the work of a force along its displacement; J."""
    return float(np.sum((f[1:] + f[:-1]) / 2 * np.diff(x)))


def secant(x, f, f_end):
    """Return the secant stiffness of the first loading to a force; N/m."""
    n = int(np.argmax(f >= f_end))
    return f_end / np.interp(f_end, f[n - 1 : n + 1], x[n - 1 : n + 1])


n_of = 4 * np.arange(1, len(u) + 1)  # index of the state at each point of the test
crossings = np.flatnonzero(np.sign(u[1:]) * np.sign(u[:-1]) <= 0)[1:] + 1
parts = np.split(np.arange(len(u)), crossings)
ub.print_once("\nhalf-cycle to     largest force: test   computed   deviation")
tested_peaks, computed_peaks = np.zeros((2, len(parts) - 1))
for k, part in enumerate(parts[:-1]):
    states = slice(n_of[part[0]], n_of[part[-1]] + 1)
    tested_peaks[k], computed_peaks[k] = np.abs(F[part]).max(), np.abs(force[states]).max()
    far = 1e3 * u[part][np.argmax(np.abs(u[part]))]
    kilonewtons = f"{tested_peaks[k] / 1e3:19.1f} {computed_peaks[k] / 1e3:10.1f} kN"
    deviation = 100 * (computed_peaks[k] / tested_peaks[k] - 1)
    ub.print_once(f"{far:9.1f} mm {kilonewtons} {deviation:9.1f} %")
lost, lost_here = energy(u, F), energy(moved[:, 0], force)
stiffness = [secant(x, f, 0.75 * F.max()) for x, f in ((u, F), (moved[:, 0], force))]
ratios = np.array([force.max() / F.max(), stiffness[1] / stiffness[0], lost_here / lost])
ub.print_once(f"\nlargest force: test {F.max() / 1e3:.0f} kN, computed {force.max() / 1e3:.0f} kN")
ub.print_once(f"secant stiffness: {stiffness[0] / 1e6:.1f} and {stiffness[1] / 1e6:.1f} kN/mm")
ub.print_once(f"energy of the loops: {lost / 1e3:.1f} and {lost_here / 1e3:.1f} kJ")
ub.print_once("computed over test:", *(f"{ratio:.3f}" for ratio in ratios))

# %% [markdown]
# ## By hand
#
# The flexural strength of the section by the stress block of ACI 318 (0.85 f_c over the depth
# β c, strain 0.003 at the edge, elastic-plastic bars) and statics at the foot, M = H (L + v) + P u.


# %%
def resultants(c):
    """Return axial force (compression) and moment of the stress block with neutral axis c (m)."""
    β = max(0.65, 0.85 - 0.05 * (f_c / 1e6 - 28) / 7)
    concrete = 0.85 * f_c * side * β * c  # N
    depth = side / 2 - rows  # m, from the compressed edge
    stress = np.clip(E_s * 0.003 * (1 - depth / c), -f_y, f_y)  # Pa, compression positive
    stress -= np.where(depth < β * c, 0.85 * f_c, 0.0)
    steel = stress * areas
    return concrete + steel.sum(), concrete * (side - β * c) / 2 + steel @ rows


nominal = resultants(brentq(lambda c: resultants(c)[0] - P, 0.02, side))[1]
moment = run.reaction(foot)[:, 2]
statics = force * (length + moved[:, 1]) + P * moved[:, 0]
sign = np.sign(moment @ statics)
M_test = np.abs(F * length + P * u).max()
ub.print_once(
    f"\nmoment at the foot: stress block {nominal / 1e3:.0f} kN m, computed "
    f"{np.abs(moment).max() / 1e3:.0f} kN m, test {M_test / 1e3:.0f} kN m"
)

# %% [markdown]
# ## Pictures
#
# Left: the measured and the computed loops.  Right: the largest force of each half-cycle.

# %%
INK, BLUE, ORANGE, GREY = "#222222", "#0072B2", "#D55E00", "#999999"
with ub.picture((11.5, 5.0)) as figure:
    loops, peaks = figure.subplots(1, 2, width_ratios=(1.7, 1))
    for axis in (loops.axhline, loops.axvline):
        axis(0, color=GREY, lw=0.8)
    loops.plot(1e3 * u, F / 1e3, color=INK, lw=1.6, label="test, 1986")
    loops.plot(1e3 * moved[:, 0], force / 1e3, color=ORANGE, lw=1.6, label="computed, not fitted")
    hand = nominal / length - P * np.abs(limits := np.array([0.0, 0.085])) / length
    for side_of in (1, -1):
        loops.plot(side_of * 1e3 * limits, side_of * hand / 1e3, "--", color=BLUE, lw=1.5)
    loops.plot([], [], "--", color=BLUE, label="stress block with P-Δ")
    loops.set(xlabel="displacement of the top (mm)", ylabel="lateral force (kN)", ylim=(-225, 225))
    loops.legend(loc="upper left")
    number = np.arange(1, len(parts))
    peaks.bar(number - 0.2, tested_peaks / 1e3, 0.4, color=INK, label="test")
    peaks.bar(number + 0.2, computed_peaks / 1e3, 0.4, color=ORANGE, label="computed")
    peaks.set(xlabel="half-cycle", ylabel="largest force (kN)", ylim=(0, 260))
    peaks.set_xticks([1, 5, 10, 15])
    peaks.legend(loc="upper right", ncols=2)
figure.savefig(output / "concrete_column.png")
ub.print_once("\npicture:", output / "concrete_column.png")

# %% [markdown]
# ## Verification
#
# Statics holds to the tolerance of the equilibrium.  The computed moment exceeds the one of the
# stress block, which has neither confinement nor hardening, by less than the overstrength factor
# 1.25 of capacity design.  The comparison with the test has no tolerance of its own: the assertions
# hold the deviations that were found.  The largest force and the energy deviate by less than 5 %,
# each half-cycle by less than 11 %.
#
# The stiffness is too large by a quarter, for two known reasons: bars slip out of the foundation,
# which is rigid here, and the specimen had cracked in cycles that the history lacks.  At large
# displacements the computed forces fall below the measured ones by up to 10 %: P-Δ grows and the
# cover is lost, while bars of real steel harden by more than 1 % of their stiffness.

# %%
assert np.abs(sign * moment - statics)[4:].max() < 1e-6 * np.abs(moment).max()
assert 1.0 < np.abs(moment).max() / nominal < 1.25
assert abs(energy(u, F) / measured_energy - 1) < 0.01  # of the points left out
assert np.abs(ratios[[0, 2]] - 1).max() < 0.05
assert 1.2 < ratios[1] < 1.3
assert np.abs(computed_peaks / tested_peaks - 1).max() < 0.11

# %% [markdown]
# ## Try this
#
# * `hardening=0.02`: the forces at large displacements rise,
# * a spring for the slip of the bars: `Turn(ground(0, 0), column.start, Spring(...))` and a support
#   `Pinned` instead of `Clamped`,
# * `st.KentPark.confined` instead of `st.Mander`, with `E=1000 * f_c` and `cells=6`; with 8 cells
#   Newton's method fails in the last cycles, at t = 110.
