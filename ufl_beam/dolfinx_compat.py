# SPDX-License-Identifier: MIT
"""DOLFINx 0.9 to 0.11: code that depends on the version, and checks of the installation."""

from __future__ import annotations

import logging
import os
import shlex
import sys
import sysconfig
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SOURCES = Path(__file__).resolve().parents[1]
INSTALL_HINT = (
    'Get it by conda install -c conda-forge fenics-dolfinx "petsc=*=real*" slepc4py c-compiler, '
    "by apt-get install python3-dolfinx-real (Debian 13), or in the Docker image dolfinx/dolfinx"
) + (f"; or run through {SOURCES}/env, see docs/installation.md" * (SOURCES / "env").is_file())
"""Instructions to install DOLFINx, for an installed package and for a source tree."""

try:
    from mpi4py import MPI
    from petsc4py import PETSc

    import basix.ufl
    import dolfinx
    import ffcx
    import ufl
    from dolfinx import fem as fem
    from dolfinx import graph, jit
    from dolfinx import mesh as mesh
except ImportError as error:  # pragma: no cover - depends on the machine
    raise ImportError(
        f"ufl_beam needs DOLFINx 0.9 or newer with PETSc, which is not on PyPI ({error}). "
        f"{INSTALL_HINT}"
    ) from error

VERSION = tuple(int(number) for number in dolfinx.__version__.split(".")[:2])
VERSIONS = f"DOLFINx {dolfinx.__version__} and FFCx {ffcx.__version__}"
if VERSION < (0, 9):
    raise ImportError(
        f"ufl_beam needs DOLFINx 0.9 or newer, this is {dolfinx.__version__}. {INSTALL_HINT}"
    )
if np.dtype(PETSc.ScalarType) != np.float64:
    raise ImportError(
        "ufl_beam needs PETSc with real numbers of double precision; this PETSc has "
        f"{np.dtype(PETSc.ScalarType)}. Debian: python3-dolfinx-real; conda: petsc=*=real*"
    )

if all(
    isinstance(handler, logging.NullHandler)
    for name in (None, "py.warnings")
    for handler in logging.getLogger(name).handlers
):
    # FFCx 0.9 redirects all Python warnings to the log, where they are lost without a handler.
    # An earlier warning, as with -W always, has added a handler that shows nothing.
    logging.captureWarnings(False)

if VERSION > (0, 11) and MPI.COMM_WORLD.rank == 0:
    warnings.warn(
        f"ufl_beam is tested with DOLFINx 0.9 to 0.11, and not with {dolfinx.__version__}",
        RuntimeWarning,
        stacklevel=2,
    )

TABULATE = (
    "double *A, const double *w, const double *c, const double *x, const int *entity, "
    "const uint8_t *permutation" + ("" if VERSION < (0, 10) else ", void *data"),
    "" if VERSION < (0, 10) else ", 0",
)
"""Parameters of an FFCx kernel in C, and the arguments of a call after the first six."""

FLAGS = shlex.split(os.environ.get("UFL_BEAM_CFLAGS", ""))
"""Compiler flags of the environment variable ``UFL_BEAM_CFLAGS`` for all C, after other flags; see
``make test-processors``."""


def jit_directory() -> Path:
    """Return the directory in which DOLFINx caches compiled forms."""
    return Path(_jit_options()["cache_dir"])


def _jit_options(flags: Sequence[str] = ()) -> dict[str, Any]:
    try:
        options: dict[str, Any] = jit.get_options()
    except OSError as error:
        raise RuntimeError(
            f"DOLFINx cannot read its options in {error.filename}: {error.strerror}; set "
            "XDG_CONFIG_HOME to a directory that can be read"
        ) from None
    every = [*(options["cffi_extra_compile_args"] or []), *flags, *FLAGS]
    return options | {"cffi_extra_compile_args": every}


def compile_form(
    form: ufl.Form, directory: Path | None = None, flags: Sequence[str] = ()
) -> fem.Form:
    """Compile a form with FFCx, or load it from the cache in ``directory``."""
    return _compiled(fem.form, form, directory=directory, flags=flags)


def compile_expression(value: Any, points: Array) -> fem.Expression:
    """Compile an expression for its values at points of the reference cell, (n, 1)."""
    return _compiled(fem.Expression, value, points)


def _compiled(
    create: Any, *arguments: Any, directory: Path | None = None, flags: Sequence[str] = ()
) -> Any:
    logger = logging.getLogger()
    handlers, where = logger.handlers[:], {"cache_dir": directory} if directory else {}
    depth = sys.getrecursionlimit()
    sys.setrecursionlimit(max(depth, 10_000))  # UFL recurses over the terms of a sum
    try:
        return create(*arguments, jit_options=_jit_options(flags) | where)
    finally:
        logger.handlers = handlers  # FFCx does not restore them after an interrupt
        sys.setrecursionlimit(depth)


def form_key(form: ufl.Form) -> str:
    """Return a key of a form; keys differ if FFCx compiles forms to different code."""
    return f"{form.signature()!r}\0{compiler_key()}"


def compiler_key() -> str:
    """Return a key of the versions and options of the compilers of forms."""
    options = {k: v for k, v in _jit_options().items() if k not in ("cache_dir", "timeout")}
    system = [sysconfig.get_config_var(name) for name in ("CFLAGS", "EXT_SUFFIX")]
    ours = (ffcx.__version__, dolfinx.__version__, ffcx.get_options(), options)
    return "\0".join(map(repr, (*ours, *system)))


def line_mesh(
    points: Array,
    cells: npt.NDArray[np.int64],
    comm: MPI.Intracomm = MPI.COMM_SELF,
    ranks: npt.NDArray[np.int32] | None = None,
) -> mesh.Mesh:
    """Create a mesh of straight cells (num_cells, 2); points (n, 2), or (n, 3) in space, in m.

    ``ranks`` has the process of each cell if there are several; all pass the whole mesh.
    """
    line = ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(points.shape[1],)))
    most = int(np.bincount(cells.ravel()).max(initial=2))
    more: dict[str, Any] = {} if VERSION < (0, 10) else {"max_facet_to_cell_links": most}
    if ranks is not None:
        parts = (np.array_split(x, comm.size)[comm.rank] for x in (cells, points, ranks))
        mine: Any = [*parts]
        cells, points, to = mine[0], mine[1], graph.adjacencylist(mine[2][:, None])
        more["partitioner"] = lambda *_: getattr(
            to, "_cpp_object", to
        )  # of a class in DOLFINx 0.11
    return mesh.create_mesh(comm, cells=cells, x=points, e=line, **more)


def cell_coordinates(domain: mesh.Mesh) -> Array:
    """Return the coordinates of the vertices of the cells; (num_cells, 2, 3); m."""
    geometry = domain.geometry
    dofmap = geometry.dofmap if VERSION < (0, 11) else geometry.dofmaps[0]
    return np.ascontiguousarray(geometry.x[dofmap])
