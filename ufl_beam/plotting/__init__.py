"""Pictures of models, solutions and studies."""
