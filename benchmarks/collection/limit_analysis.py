# SPDX-License-Identifier: MIT
"""Limit analysis of frames by linear programming, independent of the package."""

import numpy as np
from scipy.optimize import linprog


def limit_factor(nodes, members, held, loads, plastic, constant=None) -> float:
    """Compute the largest load factor in equilibrium with |M| <= Mp at the ends of all members.

    The static theorem for straight members without transverse loads; place nodes at point loads.

    Args:
        nodes: Coordinates; (n, 2); m.
        members: Pairs of nodes.
        held: Pairs of a node and a component, 0 to 2, without an equation of equilibrium.
        loads: Forces and moments at the nodes, times the factor; (n, 3); N, N m.
        plastic: Plastic moments of the members; N m.
        constant: Constant forces and moments at the nodes; (n, 3); N, N m.
    """
    nodes = np.asarray(nodes, dtype=float)
    count = 3 * len(members)
    balance = np.zeros((3 * len(nodes), count + 1))
    for m, (a, b) in enumerate(members):
        x, y = nodes[b] - nodes[a]
        length = np.hypot(x, y)
        axis, normal = np.array([x, y]) / length, np.array([-y, x]) / length
        # Unknowns: tension, and the moments that act on the member at both ends.
        balance[3 * a : 3 * a + 2, 3 * m] = axis
        balance[3 * b : 3 * b + 2, 3 * m] = -axis
        for k, node in ((1, a), (2, b)):
            balance[3 * a : 3 * a + 2, 3 * m + k] = -normal / length
            balance[3 * b : 3 * b + 2, 3 * m + k] = normal / length
            balance[3 * node + 2, 3 * m + k] = -1.0
    balance[:, -1] = np.ravel(loads)
    right = np.zeros(3 * len(nodes)) if constant is None else -np.ravel(constant).astype(float)
    free = [i for i in range(3 * len(nodes)) if (i // 3, i % 3) not in set(held)]
    bounds = [pair for moment in plastic for pair in ((None, None), *[(-moment, moment)] * 2)]
    found = linprog(
        np.r_[np.zeros(count), -1.0],
        A_eq=balance[free],
        b_eq=right[free],
        bounds=[*bounds, (0, None)],
    )
    if not found.success:
        raise ValueError(found.message)
    return float(found.x[-1])
