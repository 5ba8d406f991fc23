import numpy as np, ufl_beam as ub
sec=ub.Section(EA=1e6,GA=1e6,EI=100.,rhoA=1.,rhoI=.01)
beam=ub.Beam((0,0),(1,0),sec,cells=4)
for kw in ({}, dict(damping=.5), dict(friction=.2, radius=.02), dict(damping=.5,friction=.2, radius=.02)):
  for scheme in (ub.Static(), ub.ExactStatic(), ub.Midpoint(), ub.Newmark(), ub.DecayingMidpoint(), ub.GeneralizedAlpha(0.8)):
    b=ub.Bushing(ub.ground(1,0), beam.end, ub.Clearance(1e5, gap=1e-3, **kw))
    sc=ub.Scene([beam],supports=[ub.Clamped(beam.start)],loads=[ub.PointLoad(beam.end,force=(3,-40),time=ub.ramp(.05))],connectors=[b])
    run=ub.simulate(sc,scheme,t=(0,.2),dt=.005)
    print(type(scheme).__name__, kw, run.energy.worst, run.iterations, run.parts, {k:v[-1] for k,v in run.energy.lost.items()}, run.warnings[:100])
    m=run.connector(b)
    print("   ", m.motion[-1], m.force[-1], m.work[-1], m.dissipated[-1])
