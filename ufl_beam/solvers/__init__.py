"""Solution of the equation of a step: Newton's method, factorization, eigenvalues."""
