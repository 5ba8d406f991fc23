# Every target runs through ./env, which brings DOLFINx where it is missing. `make` lists the targets.
.DEFAULT_GOAL := help
.PHONY: help demo test test-mpi test-sid test-processors verify sanitize long demos demos-cheap check check-paraview docs docs-cheap docs-links test-notebook check-docs docs-pictures accelerations bench bench-test bench-compare bench-peers bench-steps bench-structures collection extremes schemes study

# Natively as root Open MPI refuses to start; with more ranks than cores, too (the last two lines: versions 5 and 6).
# ./env sets the same in its root.
export OMPI_ALLOW_RUN_AS_ROOT = 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM = 1
export PRTE_MCA_rmaps_default_mapping_policy = :oversubscribe
export PRTE_MCA_mapby = :oversubscribe
# Ranks that wait leave the core to the others: three of them share the two cores of a small machine.
export OMPI_MCA_mpi_yield_when_idle = 1

# $(call mpi,N) COMMAND...: a rank that fails alone leaves the others waiting, hence the limit in seconds; only the first rank writes to the terminal; what another writes is shown if it fails.
mpi = ./env timeout 2400 mpirun -n $(1) sh -c 'rank=$${OMPI_COMM_WORLD_RANK:-$${PMI_RANK:-0}}; [ $$rank = 0 ] && exec "$$@"; \
	log=.rank$$rank.log; "$$@" >$$log 2>&1 && exec rm $$log; status=$$?; echo "rank $$rank:"; cat $$log; exit $$status' -
pytest_mpi = python3 -m pytest -q --color=no -p no:cacheprovider
# With 3 ranks one of them has neighbours on both sides, and sums depend on their order. This matters for shared data:
# random scenes and their invariance, elimination, gathering, files, agreement. All other units run on 2 ranks only;
# whole suites on 2 and 3 ranks took half an hour.
sharing = tests/properties $(addprefix tests/unit/test_,$(addsuffix .py,archive checkpoint collective_errors csr factorization file_locks mesh modes output_files parameter_study recorders reference_solver replicas solution space_processes static_condensation substructuring))
cheap_demos = $(addprefix demos/demo_,$(addsuffix .py,the_card four_beam_swing roll_up emergency_stop fibre_damping monte_carlo calibration adaptive_steps lee_frame pushover hinge_snapback rotating_beam concrete_column steel_frame hinges_or_dampers inverted_pendulum))

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 12

demo: ## the first demo: a four-beam swing
	@./env python3 demos/demo_four_beam_swing.py

test: ## the tests, without the slow ones, on all cores
	@./env sh -ec '$(with_workers) python3 -m pytest $$workers'

test-mpi: ## unit tests on 2 ranks; properties and tests of sharing on 3
	@$(call mpi,2) $(pytest_mpi) tests/unit
	@$(call mpi,3) $(pytest_mpi) $(sharing)

test-sid: ## the same as `make test` on the DOLFINx of Debian sid, and a demo; builds its root once
	@UFL_BEAM_SUITE=sid $(MAKE) --no-print-directory test
	@UFL_BEAM_SUITE=sid ./env python3 demos/demo_roll_up.py

test-processors: ## the unit tests with C for other processors and other rounding; `make test-processors every=10` a tenth of them
	@tests/processors $(every)

verify: ## the slow verification studies, then the unit tests with sanitizers
	@./env python3 -m pytest -m slow
	@$(MAKE) --no-print-directory sanitize

sanitize: ## the unit tests with address and undefined-behaviour sanitizers in C; `make sanitize every=10` a tenth of them
	@./env sh -ec '$(with_workers) $(with_sanitizers) python3 -m pytest $$workers tests/unit --capture=sys -p no:cacheprovider --every=$(every)'

long: ## a million steps of a softening frame: memory, files and ledger; a quarter of an hour
	@UFL_BEAM_STEPS=1000000 ./env python3 -m pytest -m slow -s tests/verification/test_long_run.py

demos: ## all demos one after the other, then the cheap ones on 2 ranks
	@$(call alone,demos/demo_*.py)
	@$(call on_two,$(cheap_demos))

demos-cheap: ## the cheap demos, alone and on 2 ranks
	@$(call alone,$(cheap_demos))
	@$(call on_two,$(cheap_demos))

check: ## lint, format, types, layers of imports and prose
	@./env sh -ec '$(with_ruff); $$ruff check; $$ruff format --check; python3 -m mypy; python3 -m pytest -q tests/lint'

check-paraview: ## time series opened in ParaView; builds a root with ParaView once, 2.3 GB
	@tests/paraview/check

docs: ## the documentation site, in docs/_build/html; runs the demos, six minutes
	@$(site)

docs-cheap: ## the site with the output of the cheap demos only; two minutes
	@export UFL_BEAM_DEMOS=cheap; $(site)

docs-links: ## addresses that the pages link to
	@$(sphinx) -D nb_execution_mode=off -b linkcheck docs docs/_build/links

test-notebook: ## the notebook in a kernel of Jupyter
	@docs/python -m pytest -q -p no:cacheprovider tests/unit/test_notebook.py

check-docs: ## the built site in Chromium, on a desk and on a phone; builds a root with Chromium once, 0.9 GB
	@tests/browser/check

docs-pictures: docs ## pictures in docs/pictures: of pages, demos, stored measurements, and the site
	@./env python3 tests/unit/pages.py
	@./env python3 benchmarks/study --report
	@./env python3 benchmarks/peers/report.py
	@cp demos/output/emergency_stop.png demos/output/swing_shapes.png docs/pictures
	@tests/browser/check
	@mkdir -p docs/pictures/site
	@for page in first_page gallery demo reference_page; do cp output/site/$${page}_*.png docs/pictures/site; done

extremes: ## results at extreme parameters, as tables in docs/extremes.md
	@./env python3 benchmarks/extremes

collection: ## models that are hard to converge, as docs/collection.md; five to thirty minutes with OpenSees
	@./env python3 benchmarks/collection

study: ## cost and error of each setting, as docs/study.md; twenty minutes, `make study only=--quick` two
	@./env python3 benchmarks/study $(only)

schemes: ## errors of the time schemes at equal steps, as tables in docs/schemes.md
	@./env python3 benchmarks/schemes.py

accelerations: ## time of a step without each acceleration, as docs/accelerations.md; under ten minutes
	@./env python3 benchmarks/bench_accelerations.py

bench: ## time per step
	@./env python3 benchmarks/bench_step.py
	@./env python3 benchmarks/bench_inelastic.py
	@./env python3 benchmarks/bench_nothing.py
	@./env python3 benchmarks/bench_budget.py
	@./env python3 benchmarks/bench_scaling.py
	@./env python3 benchmarks/bench_ensemble.py
	@./env python3 benchmarks/bench_space.py

bench-test: ## tests of the benchmarks
	@./env python3 -m pytest -q benchmarks/tests

bench-compare: ## benchmarks of two commits in turn: `make bench-compare with=COMMIT only="bench_step"`
	@./env python3 benchmarks/compare.py $(with) $(if $(only),--only $(only))

bench-peers: ## time, memory and error beside Exudyn, OpenSees and a C loop, as docs/peers.md
	@./env python3 benchmarks/peers

bench-steps: ## error of the time steps beside Exudyn and OpenSees, as docs/peers.md
	@./env python3 benchmarks/peers/compare_steps.py

bench-structures: ## sections, a column, hinges and a frame beside OpenSees, as docs/peers.md
	@./env python3 benchmarks/peers/compare_structures.py

alone = set -e; for demo in $(1); do echo "== $$demo"; ./env python3 $$demo; done
on_two = set -e; for demo in $(1); do echo "== $$demo, 2 ranks"; $(call mpi,2) python3 $$demo; done

# Warnings are errors. All is built anew: what is kept does not notice changes of the package.
sphinx = rm -rf docs/_build; docs/python -m sphinx -q -W --keep-going
site = $(sphinx) -b html -d docs/_build/doctrees docs docs/_build/html && \
	echo "$$(find docs/_build/html -name '*.html' | wc -l) pages, $$(du -sh docs/_build/html | cut -f1): docs/_build/html/index.html"

# The library of the address sanitizer must be the first one of Python; exceptions of C++ need theirs beside it. Leaks are
# looked for by no one: Python and MPI leave many. Each object has memory of its own, so that one sees where it ends, and
# what is printed when the run ends goes past pytest. Stacks are not kept after a return: gcc stores vectors of AVX-512 there
# as if they were aligned, and crashes (its bug 110027).
every ?= 1
with_sanitizers = export UFL_BEAM_SANITIZE=1 PYTHONMALLOC=malloc PETSC_OPTIONS=-no_signal_handler; \
	export ASAN_OPTIONS=detect_leaks=0:abort_on_error=1:allocator_may_return_null=1:detect_stack_use_after_return=0 UBSAN_OPTIONS=print_stacktrace=1; \
	LD_PRELOAD=$$(gcc -print-file-name=libasan.so):$$(gcc -print-file-name=libstdc++.so.6)

# One process of pytest for each core if pytest-xdist is there; those that run out of tests take some from others. Compiled
# modules are kept, also where PYTHONDONTWRITEBYTECODE is set: each process would compile 250 modules of tests, 5 s, and each
# script that tests start those of the package, 0.6 s.
with_workers = unset PYTHONDONTWRITEBYTECODE; workers=$$(python3 -c "import xdist" 2>/dev/null && echo "-n auto --dist worksteal" || :);

# ruff, which Debian lacks: from a venv beside the root of ./env, made on first use; its version is in pyproject.toml, and
# the same in .pre-commit-config.yaml.
with_ruff = tools=$${XDG_CACHE_HOME:-$$HOME/.cache}/ufl_beam/tools; ruff=$$tools/bin/ruff; \
	$$ruff --version >/dev/null 2>&1 || { python3 -m venv --system-site-packages $$tools; \
	$$tools/bin/pip install -q "ruff$$(sed -n "s/^required-version = \"\([^\"]*\)\".*/\1/p" pyproject.toml)"; }
