# Two commands, each with its set-up:  make demo   make test
# During work: make check   make test-core   make test-fast   make test-variants   make test-studies
#              make messages   make docs   make tutorials
# Any of these with another environment and Python:
#              make test-core VENV=.venv-3.13 PYTHON=/usr/bin/python3.13
UV_VERSION := 0.13.8
PYTHON_RANGE := >=3.11,<3.15
UV := $(shell command -v uv 2>/dev/null || echo .tools/bin/uv)
export UV_PYTHON_DOWNLOADS := never
export UV_COMPILE_BYTECODE := 1
export UV_SYSTEM_CERTS := 1
VENV := .venv
PYTHON := $(PYTHON_RANGE)
BIN := $(VENV)/bin

.PHONY: demo test test-studies test-fast test-core test-variants messages check lint docs tutorials gallery pythons wheel \
  release run-package bench cost-model setup gl browser lock clean

demo: setup gl
	$(BIN)/robotball demo

# All tests of a file run on one core, because they share results.
ON_CORES := --numprocesses auto --dist loadfile

# mypy runs in parallel and reports after the tests. To run only some tests:
#   make test TESTS='core and not slow'
TESTS := not study

test: setup gl browser lint
	@mkdir -p out; $(BIN)/mypy >out/mypy.txt 2>&1 & mypy=$$!; \
	echo '$(BIN)/pytest $(ON_CORES) -m "$(TESTS)", and $(BIN)/mypy'; \
	$(BIN)/pytest $(ON_CORES) -m "$(TESTS)"; tests=$$?; \
	wait $$mypy; types=$$?; echo "mypy:"; cat out/mypy.txt; \
	echo "exit status: pytest $$tests, mypy $$types"; \
	test $$tests = 0 && test $$types = 0

# All cases of studies with many cases, such as planted wrong settings. Takes an hour.
test-studies: setup
	$(BIN)/pytest $(ON_CORES) -m study

test-fast: setup gl
	$(BIN)/pytest $(ON_CORES) -m "not slow"

# The fast tests that find most faults, in one process. Takes a minute and a half.
test-core: setup
	$(BIN)/pytest -m "core and not slow"

# Rounding errors of other processors: other kernels of OpenBLAS, generic code of numba, loops of
# NumPy without AVX-512 and without AVX2. All variants run; the failing ones are named at the end.
# With slow tests:  make test-variants MARK=
VARIANTS := OPENBLAS_CORETYPE=Haswell OPENBLAS_CORETYPE=Zen OPENBLAS_CORETYPE=Sandybridge \
  OPENBLAS_CORETYPE=Nehalem NUMBA_CPU_NAME=generic \
  NPY_DISABLE_CPU_FEATURES=X86_V4,AVX512_ICL,AVX512_SPR \
  NPY_DISABLE_CPU_FEATURES=X86_V3,X86_V4,AVX512_ICL,AVX512_SPR
MARK := not slow

test-variants: setup gl
	@failed=; for variant in $(VARIANTS); do \
	  echo "$$variant"; \
	  env $$variant $(BIN)/pytest $(ON_CORES) -m "$(MARK)" || failed="$$failed $$variant"; \
	done; test -z "$$failed" || { echo "failing under:$$failed"; exit 1; }

# Write all messages that tests cause into tests/golden/messages.txt, after changing one.
messages: setup
	$(BIN)/pytest -q tests/test_messages.py --rewrite

check: lint
	$(BIN)/mypy

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# Generate docs/scene.md and docs/scene.schema.json from the tables of the scene reader (a test
# compares them), then the site in out/site, which fails at a dead link or an unknown name.
docs: setup
	$(BIN)/python -m bench.scene_page
	$(BIN)/python -m zensical build --clean --strict

# Run the notebooks of docs/tutorials and write their outputs and pages. Takes a minute.
tutorials: setup
	$(BIN)/python docs/tutorials/notebooks.py

# Make every picture and table of README and docs. Takes hours on two cores. To select commands by
# their first words:  make gallery ONLY='history examples'
gallery: setup gl
	$(BIN)/python -m bench.gallery $(ONLY)

# The Pythons of this machine that robotball supports, newest first:  3.13=/usr/bin/python3.13
LIST_PYTHONS = $(BIN)/python -c \
  'from robotball.engines.environments import pythons; [print(f"{version}={path}") for version, path in pythons().items()]'

pythons: setup
	@$(LIST_PYTHONS)

# Test the wheel as users install it, with pip and its dependencies, in an empty folder with an empty
# home, on every Python of this machine that has venv. It must have every file that the program needs
# and work beside a foreign package `validation`. Fails if no Python has venv.
# With the newest Python only:  make wheel ONE=1
RELEASE := $(CURDIR)/out/release

wheel: setup
	rm -rf $(RELEASE) && mkdir -p $(RELEASE)
	$(BIN)/python -m hatchling build -t wheel -d $(RELEASE)
	$(call run-packages,whl,$(ONE))
	@ls $(RELEASE)/licences-* >/dev/null

# Test the wheel on every Python and the sdist on the newest, list their files and licences in
# out/release/CONTENTS, and tag the commit. Uploads nothing.
release: setup
	@$(BIN)/python .ci/release versions
	@$(MAKE) --no-print-directory wheel
	$(BIN)/python -m hatchling build -t sdist -d $(RELEASE)
	$(call run-packages,tar.gz,1)
	$(BIN)/python .ci/release contents $(RELEASE)
	@$(BIN)/python .ci/release tag

# Run the package with ending $(1) on every Python, or only on the newest if $(2) is not empty.
run-packages = @for python in $$($(LIST_PYTHONS)); do \
  $(MAKE) --no-print-directory run-package VERSION=$${python%%=*} PYTHON=$${python\#*=} ENDING=$(1) || exit 1; \
  test -z "$(2)" || break; done

run-package: THERE = $(RELEASE)/$(VERSION)
run-package: ALONE = cd $(THERE)/empty && env -i PATH=/usr/bin:/bin HOME=$(THERE)/empty ../env/bin
run-package:
	rm -rf $(THERE) && mkdir -p $(THERE)/empty
	$(PYTHON) -m venv $(THERE)/env
	$(THERE)/env/bin/python -m pip install --disable-pip-version-check --no-compile --quiet $(RELEASE)/*.$(ENDING)
	$(THERE)/env/bin/python .ci/release licences > $(RELEASE)/licences-$(VERSION)
	echo 'raise ImportError("another package")' > $(THERE)/env/lib/python$(VERSION)/site-packages/validation.py
	$(ALONE)/robotball --version
	$(ALONE)/robotball export fig12 > fig12.xml
	$(ALONE)/robotball compare fig12 --preset fast --duration 0.5
	$(ALONE)/robotball report fig12 --preset fast --duration 0.5
	$(ALONE)/robotball check $(CURDIR)/examples/first_robot.xml --duration 0.5; test $$? = 1
	$(ALONE)/robotball dynamics section fig12 --count 20
	$(ALONE)/python -c 'import robotball as rb; \
	  rb.integrate(rb.load_scene("pendulum_robot"), rb.sample_times(2.0)).save("run.csv")'
	$(ALONE)/robotball fit pendulum_robot run.csv --free frame.kv
	$(ALONE)/python -c 'import robotball as rb, sys; \
	  files = rb.__file__, sys.modules[rb.compare.__module__].__file__; \
	  sys.version_info >= (3, 13) or rb.dm_environment("fig12", [[0, 0], [0, 0]]).reset(); \
	  sys.exit(any(sys.prefix not in file for file in files))'
	rm -rf $(THERE)
	@echo "$$(ls $(RELEASE)/*.$(ENDING)) runs on Python $(VERSION)"

bench: setup
	$(BIN)/python -m bench.speed
	$(BIN)/python -m bench.kernels

# Measure the constants of COST_MODEL in robotball/engines/mujoco/special_limits.py. Takes half an hour.
cost-model: setup
	$(BIN)/python -m bench.cost_model

setup: $(VENV)/.stamp

# Install the exact versions of requirements.lock, checked by hash, and this checkout. Compile the
# bytecode, so that starts are fast even if Python cannot write it, and the machine code into the
# user's cache. The packages take most of a minute, so every step prints a line.
QUIET := $(shell test -t 2 || echo --quiet)

$(VENV)/.stamp: pyproject.toml requirements.lock Makefile | $(UV)
	@echo "set-up, once: Python's environment in $(VENV)"
	@$(UV) venv --quiet --allow-existing --python '$(PYTHON)' $(VENV)
	@echo "set-up: the packages of requirements.lock, up to a minute"
	@$(UV) pip sync $(QUIET) --python $(BIN)/python --require-hashes requirements.lock
	@echo "set-up: robotball itself"
	@$(UV) pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation --editable .
# robotball engines --install needs uv.
	@test -e $(BIN)/uv || ln -sf "$$(realpath "$$(command -v $(UV))")" $(BIN)/uv
	@$(BIN)/python -m compileall -q robotball validation
	@$(BIN)/python -m bench.ahead
	@touch $@

# Without uv on this machine, install a pinned version in its own environment.
.tools/bin/uv:
	@echo "set-up: uv, which installs all packages, in .tools"
	@python3 -m venv .tools >/dev/null 2>&1 \
	  || { rm -rf .tools; .ci/apt python3-venv && python3 -m venv .tools; } \
	  || { echo "set-up needs uv, or Python's venv: sudo apt-get install python3-venv"; exit 1; }
	@.tools/bin/python -m pip install --quiet --disable-pip-version-check uv==$(UV_VERSION)

# Videos need off-screen OpenGL; all else runs without.
gl: setup
	@$(BIN)/python -m robotball.view.gl --quiet || .ci/apt libosmesa6 || true
	@$(BIN)/python -m robotball.view.gl || true

# Tests of pages need headless Chromium; without it they are skipped.
browser:
	@for browser in chromium chromium-browser google-chrome chromium-headless-shell; do \
	  command -v $$browser >/dev/null && exit 0; done; \
	.ci/apt chromium-headless-shell || echo "no Chromium: the tests of pages are skipped"

lock: | $(UV)
	$(UV) pip compile --quiet --universal --python-version 3.11 --generate-hashes \
	  --extra reference --extra parquet --extra xarray --extra bags \
	  --extra bench --extra docs --extra dev \
	  --no-header --no-annotate --upgrade --output-file requirements.lock pyproject.toml

clean:
	rm -rf .venv .venv-* .tools .cache out .pytest_cache .mypy_cache .ruff_cache .hypothesis
