# %% [markdown]
# # Slider-crank: the mechanism of every engine, and a press made of it
#
# The first scene is a mechanism with known results: a stiff crank, a flexible rod and a slider
# without mass; a constant moment drives the crank for one second.  The second scene is a press with
# a motor and its controller, a flywheel on the crank, a heavy slider with dry friction on its
# guide, a spring that pushes the slider back, and a workpiece that the slider hits before the end
# of its travel.
#
# This demo shows
#
# * `Prismatic` and `Revolute(..., multipliers=True)`, with their forces,
# * `Body` for rigid parts, `Turn`, `Slide` and `Stretch` for forces between two places,
# * `PrescribedMotion` and `Controller` as laws of a motor,
# * the ledger, with an entry for each source and sink.

# %%
# SPDX-License-Identifier: MIT
import math
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

# %% [markdown]
# ## The known mechanism
#
# The data come from Stander and Stein, in moofeKIT: round rods, and a crank a hundred times as
# stiff as the rod.  Crank and rod are collinear at the beginning, which is no dead centre for a
# driven crank.

# %%
r, l, d = 0.1524, 0.3048, 6.35e-3  # m
E, rho = 2.068427e11, 7834.64  # Pa, kg/m^3
crank = ub.Beam(
    (0, 0), (r, 0), ub.Section.circle(d, E=100 * E, nu=0, rho=rho), cells=2, name="crank"
)
rod = ub.Beam((r, 0), (r + l, 0), ub.Section.circle(d, E=E, nu=0, rho=rho), cells=8, name="rod")
pivot = ub.Pinned(crank.start)
elbow = ub.Revolute(crank.end, rod.start, multipliers=True)
guide = ub.Prismatic(ub.ground(0, 0), rod.end, axis=(1, 0), turning=True)
moment, t_off = 0.01, 1.0  # N m, s
turning = ub.PointLoad(crank.start, moment=moment, amplitude=lambda t: float(t < t_off))

mechanism = ub.Scene([crank, rod], joints=[elbow, guide], supports=[pivot], loads=[turning])
known = ub.simulate(mechanism, ub.EnergyMomentum(), t=(0.0, 3.0), dt=2.5e-3, progress=False)
ub.print_once("slider-crank with a flexible rod\n" + str(known))

# %% [markdown]
# The reference values were computed with an independent program.  Their last digits belong to a
# step of 2.5 ms; with 1 ms the angle after 3 s is 18.2574.

# %%
reference = {
    0.5: (1.04635, 0.35109), 1.0: (3.85764, 0.17295), 1.5: (7.3789, 0.34273),
    2.0: (11.1104, 0.2820), 3.0: (18.257, 0.4191),
}  # fmt: skip
plateau = 0.038576  # J
angle, x_slider = known.displacement(crank.start)[:, 2], known.position(rod.end)[:, 0]
kinetic = known.energy["kinetic"]
row = {t: int(np.argmin(np.abs(known.times - t))) for t in reference}
ub.print_once("\n    t   angle of the crank  reference   slider    reference")
for t, (angle_there, x_there) in reference.items():
    ub.print_once(
        f"  {t:3.1f} s     {angle[row[t]]:9.5f} {angle_there:12g} {x_slider[row[t]]:11.5f} m"
        f" {x_there:8g} m"
    )
free = known.times > t_off
ub.print_once(f"kinetic energy after 1 s: {kinetic[free].mean():.6f} J; reference {plateau} J")

# %% [markdown]
# ## The press
#
# The press has a rigid crank with the inertia of its flywheel, a steel rod 12 x 5 mm, and a slider
# of 2 kg.  The slider has dry friction: 5 N from its seal, and 0.2 times the force on the guide.  A
# spring pushes the slider back.  The workpiece is 1.2 mm before the dead centre, so rod and
# workpiece deform once per revolution.
#
# There are two runs, in which the press reaches 30 rad/s within 0.1 s: one with a prescribed motion
# of the motor, the other with a controller, which reads angle and speed at the beginning of each
# step and applies up to 15 N m.

# %%
radius, reach = 0.05, 0.2  # m
speed, starting, torque = 30.0, 0.1, 15.0  # rad/s, s, N m
x_start = math.sqrt(reach**2 - radius**2)  # m: the crank stands upright
gap = radius + reach - 1.2e-3 - x_start  # m: from there to the workpiece
steel = ub.Section.rectangle(b=0.012, h=0.005, E=210e9, nu=0.3, rho=7850.0)  # m, Pa, kg/m^3


def wanted(t):
    """Return the desired rotation of the crank and its rate; rad, rad/s."""
    x = min(t / starting, 1.0)
    turned = starting * (x**3 - x**4 / 2) + max(t - starting, 0.0)
    return speed * turned, speed * (3 * x**2 - 2 * x**3)


class Press:
    """Press, and its motion for 0.75 s.

    Args:
        controlled: True for a controller, False for a motor whose motion is prescribed.
    """

    def __init__(self, controlled, record=()):
        here = ub.ground(0, 0)
        self.crank = ub.Body((0, 0), mass=3.0, inertia=0.02, name="crank")  # kg, kg m^2
        self.slider = ub.Body((x_start, 0), mass=2.0, inertia=2e-3, name="slider")
        self.rod = ub.Beam((0, radius), (x_start, 0), steel, cells=8, name="rod")
        self.pin = self.crank.at(0, radius)
        self.bearing = ub.Revolute(here, self.crank.middle, multipliers=True)
        self.elbow = ub.Revolute(self.pin, self.rod.start, multipliers=True)
        self.wrist = ub.Revolute(self.rod.end, self.slider.middle, multipliers=True)
        self.guide = ub.Prismatic(here, self.slider.middle, axis=(1, 0))

        law = (
            ub.Controller(self.control)
            if controlled
            else ub.PrescribedMotion(lambda t: wanted(t)[0])
        )
        seal = ub.Coulomb(5.0, coefficient=0.2, joint=self.guide)  # N, 1
        contact = ub.Stop(2e6, high=gap)  # N/m, m
        self.motor = ub.Turn(here, self.crank.middle, law)
        self.friction = ub.Slide(ub.ground(0.1, -0.03), self.slider.at(x_start, -0.03), seal)
        self.spring = ub.Stretch(
            self.slider.at(x_start, 0.03),
            ub.ground(0.36, 0.03),
            ub.Spring(2000.0),  # N/m
        )
        self.workpiece = ub.Slide(
            ub.ground(x_start + gap, 0), self.slider.middle, contact, axis=(1, 0)
        )
        scene = ub.Scene(
            beams=[self.rod],
            bodies=[self.crank, self.slider],
            joints=[self.bearing, self.elbow, self.wrist, self.guide],
            connectors=[self.motor, self.friction, self.spring, self.workpiece],
        )
        self.run = ub.simulate(
            scene,
            ub.EnergyMomentum(alpha=0.05, beta=0.05),
            t=(0.0, 0.75),
            dt=5e-4,
            record=record,
            progress=False,
        )
        self.speed = self.run.velocity(self.crank.middle)[:, 2]

    def control(self, simulation):
        """Return a torque in proportion to the errors of angle and speed of the crank; N m."""
        angle, rate = wanted(simulation.t)
        lacks = angle - simulation.displacement(self.crank.middle)[2]  # rad
        lacks_rate = rate - simulation.velocity(self.crank.middle)[2]  # rad/s
        return min(max(40.0 * lacks + 2.0 * lacks_rate, -torque), torque)


driven = Press(controlled=False)
controlled = Press(controlled=True, record=ub.VTKHDF(output / "slider_crank.hdf", every=30))
ub.print_once("\npress, motion given\n" + str(driven.run))
ub.print_once("\npress, controlled\n" + str(controlled.run))

# %% [markdown]
# The output lists results of the machine elements.  The force of a connector resists its motion, so
# the force of a driving motor is negative.

# %%
t = driven.run.times
steady = t > 0.3  # s: up to speed
for name, one in (("motion given", driven), ("controlled", controlled)):
    bears = {part: one.run.joint(getattr(one, part)).force for part in ("elbow", "wrist", "guide")}
    largest = {part: np.linalg.norm(force, axis=1).max() for part, force in bears.items()}
    T = -one.run.connector(one.motor).force
    hits = one.run.connector(one.workpiece)
    ub.print_once(
        f"\n{name}: {one.speed[steady].min():.2f} to {one.speed[steady].max():.2f} rad/s, "
        f"torque {T.min():.1f} to {T.max():.1f} N m\n  workpiece at most {hits.force.max():.0f} N;"
        f" bears at most: elbow {largest['elbow']:.0f} N, wrist {largest['wrist']:.0f} N, guide "
        f"{largest['guide']:.0f} N\n  friction took {one.run.energy['friction'][-1]:.3f} J, "
        f"the spring holds {one.run.connector(one.spring).work[-1]:.3f} J"
    )

# %% [markdown]
# ## Pictures

# %%
ink, grey, blue, sky, orange, red, green = (
    "#222222", "0.6", "#0072B2", "#56B4E9", "#E69F00", "#D55E00", "#009E73",
)  # fmt: skip

with ub.picture((10, 7)) as figure:
    (angles, slides), (forces, energies) = figure.subplots(2, 2, sharex=True)
    at = list(reference)
    dots = {
        "ls": "none",
        "marker": "o",
        "ms": 9,
        "mfc": "none",
        "color": ink,
        "zorder": 4,
        "clip_on": False,
    }
    angles.plot(known.times, angle, color=blue)
    angles.plot(at, [reference[t][0] for t in at], label="reference", **dots)
    angles.set_title("angle of the crank (rad)", loc="left")
    angles.legend(loc="upper left")
    slides.plot(known.times, x_slider, color=blue)
    slides.plot(at, [reference[t][1] for t in at], **dots)
    slides.set_title("position of the slider (m)", loc="left")
    in_elbow, in_guide = (known.joint(joint) for joint in (elbow, guide))
    along, across = in_elbow.in_b.T
    forces.plot(known.times, along, color=red, lw=1.4, label="elbow, along the rod")
    forces.plot(known.times, across, color=orange, lw=1.4, label="elbow, across the rod")
    forces.plot(known.times, in_guide.force[:, 1], color=green, lw=1.4, label="guide")
    forces.set_title("forces on the rod (N)", loc="left")
    forces.legend(loc="lower left")
    energies.plot(known.times, 1e3 * kinetic, color=blue)
    energies.axhline(1e3 * plateau, color=ink, ls=":", lw=1.2)
    energies.text(2.0, 1e3 * plateau - 3.5, f"reference {1e3 * plateau} mJ")
    energies.set_title("kinetic energy (mJ)", loc="left")
    for axes in (forces, energies):
        axes.set_xlabel("time (s)")
    for axes in (angles, slides, forces, energies):
        axes.axvspan(0.0, t_off, color="0.94", zorder=0)
        axes.set_xlim(0, 3)
    angles.text(0.06, 2.6, "a moment\nof 0.01 N m", color="0.4")
figure.savefig(output / "slider_crank_known.png")

# %%
runs = ((driven, "motion given", orange), (controlled, "controlled", blue))
with ub.picture((10, 7)) as press, ub.picture((10, 5)) as energies:
    (speeds, torques), (pushes, loops) = press.subplots(2, 2)
    gone, balance = energies.subplots(1, 2)
    for one, label, color in runs:
        T = -one.run.connector(one.motor).force
        style = {"color": color, "lw": 1.6, "label": label}
        speeds.plot(t, one.speed, **style)
        torques.plot(t, T, **style)
        pushes.plot(t, 1e-3 * one.run.connector(one.workpiece).force, **style)
        rubbing = one.run.connector(one.friction)
        loops.plot(1e3 * (x_start + rubbing.motion), rubbing.force, **style)
        gone.plot(t, one.run.energy["friction"], **style)
    speeds.set(ylim=(26.5, 34.5), title="speed of the crank (rad/s)")
    torques.set(title="torque of the motor (N m)")
    pushes.set(title="force of the workpiece (kN)")
    loops.set(title="friction (N) over the position of the slider (mm)")
    gone.set(title="lost by friction (J)")
    energy, entries = controlled.run.energy, {}
    entries = {
        "in scene: kinetic": (energy["kinetic"], blue), "in scene: stored": (energy["stored"], sky),
        "lost: friction": (energy["friction"], red), "lost: scheme": (energy["numerical"], grey),
    }  # fmt: skip
    balance.stackplot(
        t, *(values - values[0] for values, _ in entries.values()), labels=list(entries),
        colors=[color for _, color in entries.values()], alpha=0.85, lw=0,
    )  # fmt: skip
    balance.plot(t, energy["controllers"], color=ink, label="supplied: motor")
    balance.set_title("where the energy is, controlled (J)")
    energies.legend(*balance.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    for axes in (speeds, torques, pushes, gone, balance):
        axes.set_xlim(0, t[-1])
        axes.set_xlabel("time (s)")
    for axes in (speeds, torques, pushes, loops, gone, balance):
        axes.set_title(axes.get_title(), loc="left")
        axes.set_title("")
    speeds.legend(loc="lower right")
press.savefig(output / "slider_crank_press.png")
energies.savefig(output / "slider_crank_energy.png")
turn = 2 * math.pi / speed
shapes = ub.plot(controlled.run, "shapes", times=np.linspace(0.4, 0.4 + 0.5 * turn, 6))
shapes.savefig(output / "slider_crank_shapes.png")
ub.animate(controlled.run, output / "slider_crank.gif", seconds=2, thickness=2, size=(640, 368))
ub.print_once("\npictures and data:", *sorted(str(p) for p in output.glob("slider*")), sep="\n  ")

# %% [markdown]
# ## Verification
#
# Angles, positions and energy agree with another program.  Joints do no work, so the energy is
# constant after the moment has ended.  The sum of the forces of pivot and guide equals the rate of
# the momentum of the mechanism.  In the press the torque of the motor balances the torque of the
# elbow force, because the crank has a constant speed.  Friction dissipates its force times the
# path, the spring dissipates nothing, and the ledger closes.

# %%
for t_known, (angle_there, x_there) in reference.items():
    # Half of the last printed digit, and 2e-5 for the steps of another program.
    digits = 5e-4 if t_known == 3.0 else 5e-5
    assert abs(angle[row[t_known]] - angle_there) < digits + 2e-5 * angle_there, t_known
    assert abs(x_slider[row[t_known]] - x_there) < 5e-5, t_known
assert abs(kinetic[free].mean() - plateau) < 1e-6
total = known.energy.total[free]
assert np.ptp(total) < 1e-9 * total[0]
# The moment does work on 2 tan(Δψ/2), larger than Δψ = 0.016 rad by the fraction (Δψ)²/12.
assert abs(known.energy["loads"][-1] / (moment * angle[row[1.0]]) - 1) < 1e-4
pushed = known.reaction(pivot)[1:, :2] + in_guide.force[1:]
grown = np.diff(known.momentum()[:, :2], axis=0) / np.diff(known.times)[:, None]
assert np.abs(pushed - grown).max() < 1e-6 * np.abs(pushed).max()

for one in (driven, controlled):
    energy = one.run.energy
    rubbing, hits = one.run.connector(one.friction), one.run.connector(one.workpiece)
    press_on = np.abs(one.run.joint(one.guide).force[:, 1])
    assert energy.worst < 1e-9
    assert one.run.iterations <= 6 * one.run.substeps
    assert np.all(np.diff(energy["friction"]) >= 0)
    assert abs(rubbing.work[-1] / energy["friction"][-1] - 1) < 1e-9
    limit = 5.0 + 0.2 * press_on[:-1]
    assert np.all(np.abs(rubbing.force[1:]) < (1 + 1e-9) * limit)
    assert np.all(hits.force[hits.motion < -1e-4] == 0.0)
    assert hits.force.max() > 2000.0
assert known.energy.worst < 1e-9
assert known.iterations <= 6 * known.substeps
assert np.abs(driven.speed[steady] / speed - 1).max() < 1e-4
assert np.abs(controlled.speed[steady] / speed - 1).max() < 0.06
assert abs(controlled.speed[steady].mean() / speed - 1) < 1e-3
force = driven.run.joint(driven.elbow).force
arm = driven.run.position(driven.pin)
arm = (arm[1:] + arm[:-1]) / 2
lever = arm[:, 0] * force[1:, 1] - arm[:, 1] * force[1:, 0]
T = -driven.run.connector(driven.motor).force[1:]
apart = np.abs(T - lever)[steady[1:]].max()
ub.print_once(
    f"torque against the lever of the elbow's force: {apart:.1e} N m apart, of {T.max():.1f}"
)
ub.print_once("reference values reproduced")

# %% [markdown]
# ## Try this
#
# * a `gap` that ends 3 mm before the dead centre: can the controller still drive the press?
# * `coefficient=0.8`: how much more power does the motor need?
# * `EnergyMomentum()` instead of `alpha = beta = 0.05`: how long does the rod vibrate after a
#   stroke?
