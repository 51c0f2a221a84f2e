# Two commands, each with all its own set-up:  make demo   make test
# On the way:  make check   make test-core   make test-fast   make test-variants   make test-studies
#              make messages   make docs   make tutorials
# Any of these in another environment, with another Python:
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
  run-wheel bench cost-model setup gl browser lock clean

demo: setup gl
	$(BIN)/robotball demo

# Files go to the cores whole, as a file's tests share what they compute.
ON_CORES := --numprocesses auto --dist loadfile

# mypy runs beside the tests, and prints its report after theirs. Only some of the tests:
#   make test TESTS='core and not slow'
TESTS := not study

test: setup gl browser lint
	@mkdir -p out; $(BIN)/mypy >out/mypy.txt 2>&1 & mypy=$$!; \
	echo '$(BIN)/pytest $(ON_CORES) -m "$(TESTS)", and $(BIN)/mypy'; \
	$(BIN)/pytest $(ON_CORES) -m "$(TESTS)"; tests=$$?; \
	wait $$mypy; types=$$?; echo "mypy:"; cat out/mypy.txt; \
	echo "exit status: pytest $$tests, mypy $$types"; \
	test $$tests = 0 && test $$types = 0

# Every case of the studies that have many, such as wrong settings that are planted; an hour.
test-studies: setup
	$(BIN)/pytest $(ON_CORES) -m study

test-fast: setup gl
	$(BIN)/pytest $(ON_CORES) -m "not slow"

# The fast tests that catch most faults, in one process: a minute and a half of one core.
test-core: setup
	$(BIN)/pytest -m "core and not slow"

# Last bits, as other processors have them: OpenBLAS's kernels, numba's code without a processor's
# own instructions, NumPy's loops without AVX-512 and without AVX2. All are run, and those that fail
# are named at the end. The slow tests too:  make test-variants MARK=
VARIANTS := OPENBLAS_CORETYPE=Haswell OPENBLAS_CORETYPE=Zen OPENBLAS_CORETYPE=Sandybridge \
  OPENBLAS_CORETYPE=Nehalem NUMBA_CPU_NAME=generic \
  NPY_DISABLE_CPU_FEATURES=X86_V4,AVX512_ICL,AVX512_SPR \
  NPY_DISABLE_CPU_FEATURES=X86_V3,X86_V4,AVX512_ICL,AVX512_SPR
MARK := not slow

test-variants: setup gl
	@failed=; for each in $(VARIANTS); do \
	  echo "$$each"; \
	  env $$each $(BIN)/pytest $(ON_CORES) -m "$(MARK)" || failed="$$failed $$each"; \
	done; test -z "$$failed" || { echo "failing under:$$failed"; exit 1; }

# All messages that tests provoke, in tests/golden/messages.txt: to read, and after a change of words.
messages: setup
	$(BIN)/pytest -q tests/test_messages.py --rewrite

check: lint
	$(BIN)/mypy

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# docs/scene.md and docs/scene.schema.json, from the tables that the reader uses; tests hold both.
# Then the site, in out/site; it ends at a dead link and at a name that is not there.
docs: setup
	$(BIN)/python -m bench.scene_page
	$(BIN)/python -m zensical build --clean --strict

# The notebooks of docs/tutorials, run again, with their outputs and pages; a minute.
tutorials: setup
	$(BIN)/python docs/tutorials/notebooks.py

# Every picture and table of README and docs, made again by the program; hours on two cores. Some,
# by the beginnings of their commands:  make gallery ONLY='history examples'
gallery: setup gl
	$(BIN)/python -m bench.gallery $(ONLY)

# The Pythons of this machine that robotball runs on, the newest first:  3.13=/usr/bin/python3.13
LIST_PYTHONS = $(BIN)/python -c \
  'from robotball.engines.environments import pythons; [print("=".join(map(str, each))) for each in pythons().items()]'

pythons: setup
	@$(LIST_PYTHONS)

# The wheel, as a user installs it: by pip with its dependencies, on every Python of this machine that
# has venv, run in an empty folder and with an empty home. It must have every file that the program
# needs, and take no name that is anybody's. Without venv nothing is tested, which is an error.
# The newest Python alone:  make wheel ONE=1
WHEEL := $(CURDIR)/out/wheel

wheel: setup
	rm -rf $(WHEEL) && mkdir -p $(WHEEL)
	$(BIN)/python -m hatchling build -t wheel -d $(WHEEL)
	@for each in $$($(LIST_PYTHONS)); do \
	  $(MAKE) --no-print-directory run-wheel VERSION=$${each%%=*} PYTHON=$${each#*=} || exit 1; \
	  test -z "$(ONE)" || break; done
	@ls $(WHEEL)/3.* >/dev/null

run-wheel: THERE = $(WHEEL)/$(VERSION)
run-wheel: ALONE = cd $(THERE)/empty && env -i PATH=/usr/bin:/bin HOME=$(THERE)/empty ../env/bin
run-wheel:
	mkdir -p $(THERE)/empty
	$(PYTHON) -m venv $(THERE)/env
	$(THERE)/env/bin/python -m pip install --disable-pip-version-check --no-compile --quiet $(WHEEL)/*.whl
	echo 'raise ImportError("another package")' > $(THERE)/env/lib/python$(VERSION)/site-packages/validation.py
	$(ALONE)/robotball --version
	$(ALONE)/robotball export fig12 > fig12.xml
	$(ALONE)/robotball compare fig12 --preset fast --duration 0.5
	$(ALONE)/robotball report fig12 --preset fast --duration 0.5
	$(ALONE)/robotball check $(CURDIR)/examples/first_robot.xml --duration 0.5; test $$? = 1
	$(ALONE)/robotball section fig12 --count 20
	$(ALONE)/python -c 'import robotball as rb; \
	  rb.integrate(rb.load_scene("pendulum_robot"), rb.sample_times(2.0)).save("run.csv")'
	$(ALONE)/robotball fit pendulum_robot run.csv --free frame.kv
	$(ALONE)/python -c 'import robotball as rb, sys; \
	  files = rb.__file__, sys.modules[rb.compare.__module__].__file__; \
	  sys.version_info >= (3, 13) or rb.dm_environment("fig12", [[0, 0], [0, 0]]).reset(); \
	  sys.exit(any(sys.prefix not in file for file in files))'
	rm -rf $(THERE)/env
	@echo "the wheel runs on Python $(VERSION)"

bench: setup
	$(BIN)/python -m bench.speed
	$(BIN)/python -m bench.kernels

# The constants of COST_MODEL in robotball/engines/mujoco/limits.py, measured again; half an hour.
cost-model: setup
	$(BIN)/python -m bench.cost_model

setup: $(VENV)/.stamp

# The exact versions and hashes of requirements.lock, then this checkout itself; compiled, so that
# the first start is as quick as any other, and any where Python may not write; then the machine
# code, into the user's cache. Each step says what it does, as the packages take most of a minute,
# and uv shows its progress on a terminal.
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
	@$(BIN)/python -c 'from robotball.theory.ahead import compile_all; compile_all()'
	@touch $@

# A machine without uv gets a pinned one in a tool environment of its own.
.tools/bin/uv:
	@echo "set-up: uv, which installs all packages, in .tools"
	@python3 -m venv .tools >/dev/null 2>&1 \
	  || { rm -rf .tools; .ci/apt python3-venv && python3 -m venv .tools; } \
	  || { echo "set-up needs uv, or Python's venv: sudo apt-get install python3-venv"; exit 1; }
	@.tools/bin/python -m pip install --quiet --disable-pip-version-check uv==$(UV_VERSION)

# Video needs an off-screen GL; everything else runs without one.
gl: setup
	@$(BIN)/python -m robotball.view.gl --quiet || .ci/apt libosmesa6 || true
	@$(BIN)/python -m robotball.view.gl || true

# Pages are tested in a browser without a window; where there is none these tests are skipped.
browser:
	@for each in chromium chromium-browser google-chrome chromium-headless-shell; do \
	  command -v $$each >/dev/null && exit 0; done; \
	.ci/apt chromium-headless-shell || echo "no Chromium: the tests of pages are skipped"

lock: | $(UV)
	$(UV) pip compile --quiet --universal --python-version 3.11 --generate-hashes \
	  --extra reference --extra cluster --extra parquet --extra sysid --extra bench \
	  --extra docs --extra dev \
	  --no-header --no-annotate --upgrade --output-file requirements.lock pyproject.toml

clean:
	rm -rf .venv .venv-* .tools .cache out .pytest_cache .mypy_cache .ruff_cache .hypothesis
