# %% [markdown]
# # Rotating beam: a Campbell diagram
#
# The centrifugal force stretches a blade on a rotating shaft, which increases the bending
# stiffness.  In the plane of rotation the centrifugal force also grows outwards, which reduces the
# stiffness again.  A Campbell diagram shows the natural frequencies over the speed, and the speeds
# at which an excitation once, twice, ... per revolution is in resonance.
#
# This demo shows
#
# * `ub.RotatingFrame`, a load with which steady rotation is a state of equilibrium,
# * `ub.modes(scene, n, at=steady)`: frequencies, damping ratios and shapes about this state, with
#   Coriolis forces, by SLEPc or LAPACK,
# * a closed form that bounds the frequencies, after Southwell.
#
# Data: an aluminium blade, clamped to the axis, in the plane of rotation.

# %%
# SPDX-License-Identifier: MIT
from pathlib import Path

import numpy as np

import ufl_beam as ub

output = Path("output")
output.mkdir(exist_ok=True)

L = 2.0  # m
# aluminium: m, Pa, -, kg/m^3
section = ub.Section.rectangle(b=0.20, h=0.03, E=70e9, nu=0.33, rho=2700.0)
blade = ub.Beam((0, 0), (L, 0), section, cells=40, name="blade")
root = ub.Clamped(blade.start)
inner = ub.KelvinVoigt(retardation_time=2e-5)  # s


def spinning(rate):
    """Return the blade in a frame that rotates with it at a rate in rad/s."""
    return ub.Scene([blade], supports=[root], loads=[ub.RotatingFrame(rate)], damping=[inner])


def modes_at(rate, n=3):
    """Return modes about the steady rotation, and the steady state."""
    scene = spinning(rate)
    steady = ub.simulate(scene, ub.Static(), t=(0, 1), dt=1, progress=False)
    return ub.modes(scene, n, at=steady), steady


# %% [markdown]
# ## Frequencies against the speed

# %%
rpm = np.linspace(0.0, 2400.0, 17)
rates = rpm * 2 * np.pi / 60  # rad/s
found = [modes_at(rate) for rate in rates]
frequencies = np.array([modes.frequencies for modes, _ in found])  # Hz
ratios = np.array([modes.damping for modes, _ in found])
fast, steady = found[-1]
ub.print_once(f"at rest:\n{found[0][0]}\nat {rpm[-1]:.0f} revolutions per minute:\n{fast}")
pull = steady.section_forces(blade)[0, 0]
ub.print_once(f"the root bears {pull / 1e3:.1f} kN, the tip moves out by "
       f"{1e3 * steady.displacement(blade.end)[-1, 0]:.3f} mm")  # fmt: skip

# %% [markdown]
# ## Southwell's bound
#
# With the mode shape w(x) of the blade at rest, Rayleigh's quotient gives ω² ≤ ω₀² + (k - 1) Ω².
# The axial force causes k = ∫ (L² - x²)/2 w'² dx / ∫ w² dx; the growth of the centrifugal force in
# the plane of rotation causes -1.  The shape at rest is known in closed form.

# %%
x = np.linspace(0.0, 1.0, 4001)
bounds = []
for βL, f0 in zip((1.875104, 4.694091, 7.854757), frequencies[0], strict=True):
    c = (np.cosh(βL) + np.cos(βL)) / (np.sinh(βL) + np.sin(βL))
    w = np.cosh(βL * x) - np.cos(βL * x) - c * (np.sinh(βL * x) - np.sin(βL * x))
    dw = np.gradient(w, x, edge_order=2)
    k = np.trapezoid((1 - x**2) / 2 * dw**2, x) / np.trapezoid(w**2, x)
    bounds.append(np.sqrt(f0**2 + (k - 1) * (rpm / 60) ** 2))
    ub.print_once(f"βL = {βL:.6f}: k = {k:.4f}")
bounds = np.array(bounds).T

# %% [markdown]
# ## Speeds to avoid
#
# An excitation m times per revolution has the frequency m Ω/2π, a line through the origin.

# %%
orders = (1, 2, 3, 4, 6, 8)
crossings = []
for order in orders:
    for mode in range(3):
        apart = frequencies[:, mode] - order * rpm / 60
        for i in np.flatnonzero(apart[:-1] * apart[1:] < 0):
            part = apart[i] / (apart[i] - apart[i + 1])
            crossings.append((order, mode, rpm[i] + part * (rpm[i + 1] - rpm[i])))
ub.print_once("\norder  mode  speed (1/min)")
for order, mode, speed in crossings:
    ub.print_once(f"{order:4d}P  {mode:4d}  {speed:8.0f}")

# %% [markdown]
# ## Pictures

# %%
with ub.picture((8.5, 5.5)) as figure:
    ax = figure.subplots()
    for order in orders:
        ax.plot(rpm, order * rpm / 60, color="0.75", lw=1, zorder=1)
        end = min(rpm[-1], 60 * 203 / order)
        ax.annotate(f"{order}P", (end, order * end / 60), (4, -2), textcoords="offset points",
                    color="0.5", fontsize=11)  # fmt: skip
    for mode, color in enumerate(("#0072B2", "#D55E00", "#009E73")):
        ax.plot(rpm, bounds[:, mode], color=color, lw=1.2, ls="--")
        ax.plot(rpm, frequencies[:, mode], "o-", ms=4, color=color, label=f"mode {mode}")
    for order, _, speed in crossings:
        ax.plot(speed, order * speed / 60, "s", ms=9, mfc="none", mec="0.2", mew=1.4)
    ax.plot([], [], "k--", lw=1.2, label="Southwell's bound")
    ax.plot([], [], "s", ms=9, mfc="none", mec="0.2", label="resonance")
    ax.set(xlim=(0, rpm[-1] * 1.04), ylim=(0, 210))
    ax.set_xlabel("speed (1/min)")
    ax.set_ylabel("natural frequency (Hz)")
    figure.legend(loc="outside upper left", ncols=5)
figure.savefig(output / "rotating_beam_campbell.png")

ub.plot(fast).savefig(output / "rotating_beam_modes.png")
fast.write(output / "rotating_beam.hdf")  # the k-th shape at time k
ub.print_once("\npictures:", *sorted(str(p) for p in output.glob("rotating_beam*.png")), sep="\n  ")

# %% [markdown]
# ## Verification
#
# The computed frequencies are below the bound and close to it, because the shapes change only at
# large speeds, most in the first mode.  The damping ratios of the second and third mode fall with
# the speed, because an increasing fraction of the energy is stored by the centrifugal force,
# whereas damping acts only on strains.

# %%
assert np.all(frequencies <= bounds * (1 + 1e-6))
assert np.all(frequencies[:, 1:] >= 0.98 * bounds[:, 1:])
in_theory = inner.retardation_time * np.pi * frequencies[0]  # τ ω/2 at rest
assert np.allclose(ratios[0], in_theory, rtol=1e-5)
assert np.all(np.diff(ratios[:, 1:], axis=0) < 0)
assert np.isclose(
    pull, section.rhoA * rates[-1] ** 2 * L**2 / 2, rtol=1e-2
)  # apart from the stretch of the blade

# %% [markdown]
# ## Try this
#
# * an axis of rotation at a distance from the clamp: `ub.RotatingFrame(rate, about=(-0.5, 0))`,
# * `ub.Pinned` instead of `ub.Clamped`, with this distance: a hinged blade, which swings at 9.7 Hz
#   at 100 rad/s; without the distance it turns freely, and the steady state is refused,
# * a mass at the tip, `masses=[ub.PointMass(blade.end, 5.0)]`,
# * `ub.animate(fast.motion(1), "mode.gif")`.
