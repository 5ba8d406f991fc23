# SPDX-License-Identifier: MIT
"""C of the package: no warnings, and sanitizers that see what they are to see."""

import os
import runpy
import subprocess
import sys

import numpy as np
import pytest
import ufl

from ufl_beam import dolfinx_compat
from ufl_beam.compiled import c_library, code_cache, jit, simd_kernels

pytestmark = pytest.mark.serial  # nothing here depends on the number of processes

WARNINGS = [
    "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wstrict-prototypes", "-Wpointer-arith",
    "-Wvla", "-Werror",
    # PETSc and the table of terms prescribe the arguments of functions that they call.
    "-Wno-unused-parameter",
    # A flag of the loops; sizes are int in loops.h and size_t in memset.
    "-fopenmp-simd", "-Wno-sign-conversion",
]  # fmt: skip

KERNEL = """
static inline void tabulate(lanes *restrict A, const lanes *restrict w, const lanes *restrict c,
                            const lanes *restrict x)
{
  A[0] += PICK(w[0] < x[0], lanes_sin(w[0]) + lanes_cos(x[0]), lanes_fabs(c[0]));
  A[0] += lanes_sqrt(w[0]) * lanes_pow(w[0], -2);
  A[0] += lanes_exp(w[0]) * lanes_log(x[0]) * lanes_power(w[0], x[0]) * quotient(w[0], x[0], c[0]);
}
"""


def gcc(*arguments, **options):
    """Run the compiler; skip the test where it is not GCC."""
    try:
        return subprocess.run(["gcc", *arguments], capture_output=True, text=True, **options)
    except FileNotFoundError:
        pytest.skip("needs gcc")


def lanes_source(loop):
    """The loop in a file with a kernel that asks for every function of assembly_simd.h."""
    names = "SIDE", "ENTRIES", "WIDTH", "CONSTANTS", "UNKNOWNS", "ON_CELLS"
    defined = ["#define LANES 4", "#define AT 0", *(f"#define {name} 1" for name in names)]
    head = [jit.HEADERS, jit.DECLARATIONS, *defined, jit.text("assembly_simd.h")]
    # The functions that Python calls are declared in no header: cffi reads them as text.
    interface = simd_kernels.INTERFACE.replace("_{0}", "")
    return "\n".join([*head, KERNEL, interface, jit.text("check_simd.c"), jit.text(loop)])


@pytest.mark.parametrize("loop", [None, "assembly_simd.c", "points_simd.c", "elements_simd.c"])
def test_the_compiler_warns_of_nothing(tmp_path, loop):
    """At the level of optimisation of each library."""
    file, flags = tmp_path / "source.c", ["-O2", "-march=native"] if loop else ["-O3"]
    file.write_text(lanes_source(loop) if loop else c_library._SOURCE)
    ran = gcc(*flags, *WARNINGS, "-c", str(file), "-o", str(tmp_path / "source.o"))
    assert ran.returncode == 0, ran.stderr


@pytest.mark.parametrize(
    ("fault", "report"),
    [
        ("double *volatile x = malloc(8 * n); y = x[n];", "heap-buffer-overflow"),
        ("double x[4] = {1}; y = x[n];", "index 4 out of bounds"),
        ("y = INT_MAX - 3 + n;", "signed integer overflow"),
        ("double *x = n == 4 ? 0 : &y; y = *x;", "null pointer"),
    ],
)
def test_sanitizers_report_a_fault(tmp_path, fault, report):
    """A small program with a fault ends with a report."""
    source, program = tmp_path / "fault.c", tmp_path / "fault"
    source.write_text(
        "#include <limits.h>\n#include <stdio.h>\n#include <stdlib.h>\n"
        "int main(int n, char **names) { (void)names; volatile double y = 0; "
        f'{fault} printf("%g\\n", y); return 0; }}\n'
    )
    # As Python's own flags do, which come before those of the package.
    built = gcc("-w", "-fwrapv", *jit.SANITIZERS, str(source), "-o", str(program))
    if "cannot find" in built.stderr:
        pytest.skip("gcc is there without libasan and libubsan")
    assert built.returncode == 0, built.stderr
    environment = {k: v for k, v in os.environ.items() if k != "LD_PRELOAD"}
    environment["ASAN_OPTIONS"] = "detect_leaks=0"
    ran = subprocess.run(  # four arguments: n is 4, which the compiler cannot know
        [program, "2", "3", "4"], capture_output=True, text=True, env=environment
    )
    assert ran.returncode != 0
    assert report in ran.stderr


@pytest.mark.skipif(not jit.EXTRA, reason="for `make sanitize`")
def test_this_run_is_sanitized():
    """A library that is compiled and loaded as those of the package ends this kind of run."""
    program = """if True:
        import numpy as np
        from ufl_beam.compiled import jit
        head, source = "double get(const double *x, int n)", " { return x[n]; }"
        m = jit.compiled(
            "sanitizer_probe", head + ";", lambda: head + source, depends_on=[source], flags=[]
        )
        x = m.ffi.from_buffer("double[]", np.ones(1000))
        print("last", m.lib.get(x, 999), flush=True)
        print("beyond", m.lib.get(x, 1000), flush=True)
    """
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert ran.stdout.split() == ["last", "1.0"]
    assert "heap-buffer-overflow" in ran.stderr
    assert ran.returncode != 0


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    """A cache without entries."""
    monkeypatch.setattr(code_cache, "_place", lambda: tmp_path)


def test_flags_of_the_user_reach_c_and_are_part_of_its_key(empty_cache, monkeypatch):
    source = "int get(void) { return CHOSEN; }"
    for number in (3, 4):
        monkeypatch.setattr(jit, "FLAGS", ["-UCHOSEN", f"-DCHOSEN={number}"])
        module = jit.compiled(
            "flags", "int get(void);", lambda: source, depends_on=[source], flags=["-DCHOSEN=1"]
        )
        assert module.lib.get() == number


def test_flags_of_the_user_reach_forms_and_are_part_of_their_key(empty_cache, monkeypatch):
    mesh = dolfinx_compat.line_mesh(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0, 1]]))
    form = dolfinx_compat.fem.Constant(mesh, 1.0) * ufl.dx(mesh)
    key = dolfinx_compat.form_key(form)
    monkeypatch.setattr(dolfinx_compat, "FLAGS", ["-include", "no_such_header.h"])
    assert dolfinx_compat.form_key(form) != key
    with pytest.raises(jit.CompilerError, match="a form cannot be compiled"):
        jit.compiled_form(form)


def test_flags_of_the_user_are_words_of_a_variable(monkeypatch):
    monkeypatch.setenv("UFL_BEAM_CFLAGS", "-march=x86-64 -O1")
    assert runpy.run_path(dolfinx_compat.__file__)["FLAGS"] == ["-march=x86-64", "-O1"]


@pytest.mark.parametrize(
    ("flags", "features", "wide"),
    [
        ([], ["AVX2"], False),
        ([], ["AVX2", "AVX512F"], True),
        (["-O1"], ["X86_V4"], True),
        (["-march=x86-64-v3"], ["AVX512F"], False),
        (["-march=x86-64-v3", "-march=x86-64-v4"], [], True),
    ],
)
def test_vectors_are_as_wide_as_those_of_the_chosen_processor(flags, features, wide):
    assert simd_kernels.has_wide_vectors(flags, features) is wide
