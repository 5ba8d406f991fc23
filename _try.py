from dataclasses import dataclass
import numpy as np, ufl_beam as ub
from ufl_beam.model.connectors import Bushing
f=ub.law_functions
@dataclass(frozen=True)
class Hole(ub.ConnectorLaw):
    stiffness: float
    radius: float
    components=2
    def energy(self, motion, state):
        x,y=motion
        r=f.sqrt(x**2+y**2+1e-20)
        return self.stiffness*f.positive(r-self.radius)**2/2
sec=ub.Section(EA=1e6,GA=1e6,EI=100.,rhoA=1.,rhoI=.01)
beam=ub.Beam((0,0),(1,0),sec,cells=4)
for scheme in (ub.Static(), ub.ExactStatic(), ub.Midpoint(), ub.Newmark(), ub.DecayingMidpoint()):
    b=Bushing(ub.ground(1,0), beam.end, Hole(1e5, 1e-3))
    sc=ub.Scene([beam],supports=[ub.Clamped(beam.start)],loads=[ub.PointLoad(beam.end,force=(3,-40),time=ub.ramp(.05))],connectors=[b])
    run=ub.simulate(sc,scheme,t=(0,.2),dt=.005)
    print(type(scheme).__name__, run.energy.worst, run.iterations, run.parts)
    m=[run.connector(c) for c in b.components]
    print(m[0].motion[-1],m[1].motion[-1], m[0].force[-1], m[1].force[-1], np.hypot(m[0].force[-1],m[1].force[-1])/1e5+1e-3-np.hypot(m[0].motion[-1],m[1].motion[-1]))
