# SPDX-License-Identifier: MIT
"""Pictures of models, solutions and studies."""
