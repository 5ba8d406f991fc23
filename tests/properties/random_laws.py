# SPDX-License-Identifier: MIT
"""Random numbers, and laws of sections and connectors as Python source; see random_scenes.py."""

import math

STRAINS = {"N m2": "1/m", "N": "1", "Pa": "1", "N/m": "m", "N m": "1"}
"""Dimension of what a stiffness of each dimension is multiplied by."""

INVERSE = {"1/m": "m", "1": "1", "m": "1/m"}

OF_LENGTHS = "N/m", "m", "N", "N s/m"
"""Dimensions of stiffness, motion, force and viscosity."""

IMPORTS = "import math", "import ufl_beam as ub", "import ufl_beam.structures as st", ""
"""First lines of scripts."""

CLASSES = ["ElastoPlastic", "ElastoPlastic", "RambergOsgood", "ArmstrongFrederick", "BoucWen"]


class Draws:
    """Draws of a writer, from its generator `_random`; sizes by more decades on each side."""

    _wider = 0.0

    def _chance(self, part):
        return self._random.random() < part

    def _integer(self, low, high):
        return int(self._random.integers(low, high + 1))

    def _some(self, low, high):
        return float(self._random.uniform(low, high))

    def _size(self, low, high):
        """A size whose decimal logarithm is uniform."""
        return 10 ** self._some(low - self._wider, high + self._wider)

    def _one(self, choices):
        return choices[self._integer(0, len(choices) - 1)]

    def _draw_scales(self, L, slender, EI, rhoA):
        """Sizes of the first beam, by limits of decimal logarithms: its length, EI/L², period."""
        self._L, self._slender = self._size(*L), self._size(*slender)
        self._EI, self._rhoA = self._size(*EI), self._size(*rhoA)
        self._F, self._M = self._EI / self._L**2, self._EI / self._L
        self._EA = self._EI * (self._slender / self._L) ** 2
        self._T = 2 * math.pi / 3.5 * self._L**2 * math.sqrt(self._rhoA / self._EI)

    def _polar(self, size):
        """A vector of a size."""
        angle = self._some(-math.pi, math.pi)
        return size * math.cos(angle), size * math.sin(angle)


class Laws(Draws):
    """The part of the writer of random scenes that draws laws."""

    def _hardening(self, limit, stiffness, dimensions):
        """A law that yields at a limit (text); dimensions of the stiffness and of the viscosity."""
        say, (of_stiffness, of_viscosity) = self._say, dimensions
        modulus, kinematic = (stiffness * self._size(-2, -0.5) for _ in range(2))
        time = self._end * self._size(-1, 1)
        kind = self._one(["", "isotropic", "kinematic", "both"])
        viscous = self._one(["", "", "Perzyna", "DuvautLions"])
        more = [f"yield_limit={limit}"]
        for name, size in (("isotropic", modulus), ("kinematic", kinematic)):
            if kind in (name, "both"):
                more.append(f"{name}={say.number(size, of_stiffness)}")
        if viscous:
            perzyna = time * stiffness, of_viscosity
            size = say.number(*(perzyna if viscous == "Perzyna" else (time, "s")))
            more.append(f"viscosity=ub.{viscous}({size})")
        return f"ub.ElastoPlastic({', '.join(more)})"

    def _yielding(self, name, limit, size, stiffness, dimensions):
        """A law of a class that yields at a limit; its own draws leave the others as they are."""
        hardening = self._hardening(limit, stiffness, dimensions)
        of, say, some = dimensions[0], self._say.number, self._others.uniform
        strain = size / stiffness
        strains = STRAINS[of]
        kinematic = say(stiffness * 10 ** some(-2, -0.5), of)
        recovery = say(10 ** some(-1.5, 0.5) / strain, INVERSE[strains])
        offset = say(strain * 10 ** some(-1, 0.5), strains)
        strength = self._others.choice([0.0, 0.1])
        exponent, hardens, shape = some(1, 6), some(0, 0.3), some(0.5, 1)
        smooth = f"{hardens:.2f}, {exponent:.2f}, {shape:.2f}, {strength:.1f}"
        return {
            "ElastoPlastic": hardening,
            "RambergOsgood": f"st.RambergOsgood({limit}, {offset}, {exponent:.2f})",
            "ArmstrongFrederick": f"st.ArmstrongFrederick({limit}, {kinematic}, {recovery})",
            "BoucWen": f"st.BoucWen({limit}, {smooth})",
        }[name]

    def _softening(self, limit, energy, dimensions):
        """A law that breaks; limit and energy in SI, and their dimensions."""
        kind = self._one(["Softening", "LinearSoftening"])
        limit, energy = map(self._say.number, (limit, energy), dimensions)
        return f"ub.{kind}(limit={limit}, fracture_energy={energy})"

    def _section(self, i):
        """Kind of a section, and hinges of its beam: laws by places."""
        stiff, heavy = self._size(-0.5, 0.5), self._size(-0.5, 0.5)
        EA, EI, rhoA = self._EA * stiff, self._EI * stiff, self._rhoA * heavy
        limit = self._M * stiff * self._size(-1.5, 0)
        kinds = ["resultants", "hinge", "both", "fibres", "fibres", "placed", "elastic"]
        kinds = ["fibres", "placed"] if self._scattered else kinds
        drawn = self._one(kinds)
        kind = "elastic" if self._elastic else drawn
        self._asymmetric = False
        hinges = {}
        if kind in ("fibres", "placed"):
            self._of_fibres(i, kind, EA, EI, rhoA, limit)
        elif kind == "elastic" and self._chance(0.5):
            self._of_shape(i, EA, EI, rhoA)
        else:
            hinges = self._of_resultants(i, kind, EA, EI, rhoA, limit)
        return kind, hinges

    def _of_resultants(self, i, kind, EA, EI, rhoA, limit):
        say = self._say
        more = [
            f"EA={say.number(EA, 'N')}", f"GA={say.number(EA * self._some(0.1, 0.5), 'N')}",
            f"EI={say.number(EI, 'N m2')}", f"rhoA={say.number(rhoA, 'kg/m')}",
            f"rhoI={say.number(self._one([0.0, rhoA * EI / EA]), 'kg m')}",
        ]  # fmt: skip
        hinges = {}
        if kind in ("resultants", "both"):
            name = self._others.choice(CLASSES)
            law = self._yielding(name, say.number(limit, "N m"), limit, EI, ("N m2", "N m2 s"))
            laws = [f"bending={law}"]
            force = limit / self._L * self._size(0, 1)
            for of in ("axial", "shear"):
                law = self._yielding(name, say.number(force, "N"), force, EA, ("N", "N s"))
                laws += [f"{of}={law}"] if self._chance(0.3) else []
            if kind == "resultants" and self._others.random() < 0.2:
                both = f"{say.number(force, 'N')}, {say.number(limit, 'N m')}"
                laws = [f"interaction=st.AxialBending({both})"]
            more += laws
        if kind in ("hinge", "both"):
            size, of = limit * self._size(0, 0.5), ("N m", "J")
            laws = [self._softening(size, size * self._size(-0.5, 1), of) for _ in range(2)]
            more += [f"hinge={laws[0]}"] if self._chance(0.6) else []
            # Not at vertices, where the hinge is in the cell before it.
            hinges = self._one([{}, {0.0: laws[1]}, {0.43: laws[1]}, {1.0: laws[1]}])
        self._lines.append(f"section{i} = ub.Section({', '.join(more)})")
        return hinges

    def _of_shape(self, i, EA, EI, rhoA):
        h = math.sqrt(12 * EI / EA)
        say, E, rho = self._say, EA / h**2, rhoA / h**2
        wall = say.number(h / 10, "m")
        h = say.number(h, "m")
        shape = self._one([
            f"ub.Section.rectangle({h}, {h}", f"ub.Section.circle({h}",
            f"ub.Section.tube({h}, {wall}", f"st.i_shape({h}, {h}, {wall}, {wall}",
        ])  # fmt: skip
        stiff = f"E={say.number(E, 'Pa')}, nu=0.3, rho={say.number(rho, 'kg/m3')}"
        self._lines.append(f"section{i} = {shape}, {stiff})")

    def _of_fibres(self, i, kind, EA, EI, rhoA, limit):
        """Layers of a shape, or fibres that are placed to one side."""
        say, h = self._say, math.sqrt(12 * EI / EA)
        E, strength = EA / h**2, 6 * limit / h**3
        mean, scatter = say.number(strength, "Pa"), say.number(strength / 4, "Pa")
        kinds = [f"{x}({mean}, {scatter}" for x in ("Normal", "Lognormal", "TruncatedNormal")]
        drawn = f"ub.distributions.{self._one([*kinds, f'Weibull({mean}, 3.0'])}, seed={i})"
        limit = drawn if self._scattered else mean
        law = self._yielding(self._others.choice(CLASSES), limit, strength, E, ("Pa", "Pa s"))
        size = strength * self._size(0, 0.5)
        crack = self._softening(size, size * h * self._size(-1, 0.5), ("Pa", "N/m"))
        crack = f", softening={crack}" if self._chance(0.4) else ""
        shape = self._one(["rectangle", "circle"])
        number = self._one([4, 6])
        stiff = f"E={say.number(E, 'Pa')}, nu=0.2, rho={say.number(rhoA / h**2, 'kg/m3')}"
        text = say.number(h, "m")
        if kind == "fibres":
            size = f"{text}, {text}" if shape == "rectangle" else text
            fibres = f"fibres=ub.Fibres({law}, number={number}{crack})"
            self._lines.append(f"section{i} = ub.Section.{shape}({size}, {stiff}, {fibres})")
            return
        self._asymmetric = True
        y = [h * (k + self._some(-0.3, 0.3)) / number for k in range(number)]
        A = [h**2 / number * self._some(0.5, 1.5) for _ in range(number)]
        areas = ", ".join(say.number(a, "m2") for a in A)
        up = [say.number(x, "m") for x in y]
        down = [x[1:] if x[0] == "-" else f"-{x}" for x in up]
        for name, places in (("", up), ("_upside_down", down)):
            self._lines.append(
                f"section{i}{name} = ub.Section.of_fibres([{', '.join(places)}], [{areas}], "
                f"{stiff}, fibres=ub.Fibres({law}{crack}))"
            )

    def _laws(self, stiffness, way, force, dimensions, joint=None):
        """Laws of connectors by name; dimensions of stiffness, motion, force and viscosity."""
        say, (of_k, of_e, of_f, of_c) = self._say, dimensions
        k, f = stiffness * self._size(-1.5, 1), force * self._size(-1.5, 0)
        c = stiffness * self._T * self._size(-2, 0)
        high, low = way * self._size(-2.5, -1), way * self._size(-2.5, -1)
        cubic = f"{of_k[:-1]}m3" if of_k == "N/m" else of_k
        name = self._others.choice(CLASSES)
        yields = self._yielding(name, say.number(f, of_f), f, k, (of_k, of_c))
        breaks = self._softening(f, f**2 / k * self._size(0.3, 1.5), (of_f, "J"))
        ω = say.number(self._some(1, 6) / self._end, "1/s")
        text, of = say.number(k, of_k), say.number(f, of_f)
        cubic = f"{say.number(k / way**2, cubic)} * e**3"
        viscous = f"{say.number(0.0 if self._static else c, of_c)} * rate"
        laws = {
            "Spring": f"ub.Spring({text})",
            "yields": f"ub.Spring({text}, law={yields})",
            "breaks": f"ub.Spring({text}, softening={breaks})",
            "Function": f"ub.ForceLaw(lambda e, rate: {text} * e + {cubic} + {viscous})",
            "Stop": f"ub.Stop({text}, low={say.number(-low, of_e)}, high={say.number(high, of_e)})",
            "Damper": f"ub.Damper({say.number(c, of_c)})",
            "PrescribedForce": f"ub.PrescribedForce(lambda t: {of} * math.sin({ω} * t))",
            "Controller": f"ub.Controller(lambda simulation: {of} * math.sin({ω} * simulation.t))",
            "Coulomb": f"ub.Coulomb({of})",
            "PrescribedMotion": "ub.PrescribedMotion(lambda t: "
            f"{say.number(high, of_e)} * (1.0 - math.cos({ω} * t)))",
        }
        if joint is not None:
            size = say.number(self._L * 0.1 if of_e == "1" else 0.3, "m" if of_e == "1" else "1")
            laws["Coulomb"] = f"ub.Coulomb({of}, coefficient={size}, joint={joint})"
        return laws

    def _kinds(self, *more):
        kinds = ["Spring", "yields", "breaks", "Function", *more]
        if not self._static:
            kinds += ["Stop", "Damper", "PrescribedForce", "Controller"]
            kinds += ["Coulomb", "Coulomb"] if self._rubs else []
        return kinds

    def _resist(self, text, laws):
        """A connector in a joint, with one of some laws in the text."""
        kind = self._one(self._kinds(*(["PrescribedMotion"] if self._may_hold else [])))
        if self._static and kind in ("breaks", "yields"):
            kind = "Spring"
        self._lists["connectors"].append(text.format(laws[kind]))

    def _turn(self, a, b, joint):
        """Something that resists or drives a rotation."""
        laws = self._laws(self._M, 3.0, self._M, ("N m", "1", "N m", "N m s"), joint)
        self._resist(f"ub.Turn({a}, {b}, {{}})", laws)

    def _slide(self, a, b, along, joint):
        """Something that resists or drives a sliding along an axis."""
        laws = self._laws(self._F / self._L, self._L, self._F, OF_LENGTHS, joint)
        self._resist(f"ub.Slide({a}, {b}, {{}}, axis={along})", laws)

    def _connector(self):
        """Something between two parts, or a part and the ground."""
        a, b = self._one(self._anchors), self._one(self._anchors)
        far = tuple(p + d for p, d in zip(b.point, self._polar(0.7 * self._L), strict=True))
        grounded = self._chance(0.4) or a.part == b.part
        first = f"ub.ground(*{self._say.point(far)})" if grounded else str(a)
        apart = math.dist(far if grounded else a.point, b.point)
        along = self._say.vector(self._polar(1.0))
        laws = self._laws(self._F / self._L, self._L, self._F, OF_LENGTHS)
        kind, stretch = self._one(self._kinds()), self._chance(0.6)
        text = f"ub.Slide({first}, {b}, {laws[kind]}, axis={along})"
        if stretch and apart > 0.2 * self._L:
            both = [first, str(b)]
            self._shuffle(both)
            text = f"ub.Stretch({both[0]}, {both[1]}, {laws[kind]})"
        self._lists["connectors"].append(text)
