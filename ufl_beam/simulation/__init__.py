"""From a scene to its motion: steps, solutions, checkpoints."""
