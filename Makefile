# make demo    set up and run the main job on an example: a plan and its validation
# make serve   set up and start the service at http://127.0.0.1:8000
# make check   set up and run formatter check, linter, layers, strict types and all quick tests
# make check-library, make check-service    the same with the tests of one side alone
# make check-long   what continuous integration has beside that: long tests, searches, the steps of the
#              Dockerfile, somebody else's vehicles beside the model of flight; draws are fixed
# make check-all    all of it with fresh draws, and every block of the documentation
# make crosschecks    fly the model beside RotorPy's multirotors and JSBSim's aeroplanes
# make scripts    the linter, types and unit tests of the web page's scripts
# make vendor  bundle anew the libraries of the web page, and what pages of figures bring along
# make docs    set up and build the documentation into build/site, which opens without a server
# make container-steps    follow the steps of the Dockerfile without a container
# make benchmarks    measure against peers, side by side
# make lock    renew requirements.lock, and docker/service.lock, which has the image's part of it
# make clean   remove the virtual environment and caches

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
DEMO   ?= examples/scenarios/paper-grid-same.yaml

UV     := 'uv>=0.9,<1'

# on small matrices, a second thread of BLAS costs more than it brings
TESTS  := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m
PYTEST := $(TESTS) pytest
QUICK  := --numprocesses $(shell nproc) -m "not long and not documented"
# many of the others wait: more processes than there are cores
MORE   := --numprocesses $(shell expr $$(nproc) + 1)
SERVICE := tests/service tests/attacks tests/client tests/page
# for how long fresh cases of searches are drawn
MINUTES ?= 40

export PIP_DISABLE_PIP_VERSION_CHECK = 1
# the checks start hundreds of processes: each would compile all modules anew
unexport PYTHONDONTWRITEBYTECODE

# a line of dots every four seconds, as long as a recipe goes on
going = while sleep 4 >/dev/null 2>&1; do echo ... >&2; done & trap "kill $$!" EXIT;
# a command, and what it prints; at a terminal it has a progress bar
shown = @echo '$(1)'; test -t 2 || { $(going) }; $(1)

# uv installs in a tenth of pip's time and checks the locked hashes. Where uv can't reach the package
# index, pip installs; it checks the hashes of a whole list alone, so it takes all that is locked
install = @$(going) echo "installing into $(VENV), a minute unless packages are cached" >&2; \
	sed -n '/^uv==/,/[^\]$$/p' requirements.lock > $(VENV)/uv.lock && \
	$(BIN)/pip install --quiet --require-hashes --requirement $(VENV)/uv.lock && \
	$(BIN)/uv pip install --quiet --python $(BIN)/python --constraint requirements.lock \
		--build-constraint requirements.lock --editable $(1) || \
	{ $(BIN)/pip install --quiet --require-hashes --requirement requirements.lock && \
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable $(1); }

.PHONY: demo serve check check-library check-service static scripts vendor \
	check-long long-tests fixed-searches check-all all-tests fresh-searches crosschecks docs \
	postgresql chromium firefox container-steps benchmarks lock clean

demo: $(VENV)/.run
	$(call shown,$(BIN)/syncplan plan $(DEMO) --format table)
	$(call shown,$(BIN)/syncplan validate $(DEMO) --trials 200 --seed 1 --format table)

serve: $(VENV)/.api
	$(BIN)/syncplan serve

check: static
	$(PYTEST) $(QUICK)

check-library: static
	$(PYTEST) $(QUICK) $(SERVICE:%=--ignore=%)

check-service: static
	$(PYTEST) $(QUICK) $(SERVICE)

# all but the tests; beside it, the kernels of small teams are compiled, once for all tests
static: chromium $(VENV)/.dev
	$(BIN)/python docker/warm_up.py small & \
		$(BIN)/ruff format --check . && $(BIN)/ruff check . && $(BIN)/lint-imports && $(BIN)/mypy && \
		$(MAKE) --no-print-directory scripts && wait $$!

# the scripts of the web page: linter, types, and tests of what needs no browser
scripts: $(VENV)/.page
	vendor/node_modules/.bin/biome lint --error-on-warnings api/page/*.js vendor/*.js vendor/*.mjs tests/page/*.mjs tests/crosschecks/*.mjs
	$(BIN)/node vendor/node_modules/.bin/tsc -p vendor
	$(BIN)/node --test --test-reporter=dot tests/page/*.mjs

# into api/page/vendor and syncplan/plotting/vendored
vendor: $(VENV)/.page
	cd vendor && $(abspath $(BIN))/node build.mjs

# two at a time: more would wait for the cores. What each prints stays together, but + prints at once
SIDE    = $(MAKE) --no-print-directory --output-sync --jobs 2
# aeroplanes, and multirotors on a refined plan, are flown by check-all alone
check-long: export COURSES = --courses grid
check-long: postgresql $(VENV)/.crosschecks
	$(SIDE) long-tests fixed-searches container-steps crosschecks
	@# alone: a process's share of memory grows as others that use the same libraries end
	$(TESTS) tests.searches requests

# files without a long test need not be imported; those of the page have the mark by their conftest.py
long-tests:
	+$(PYTEST) $(MORE) -m "long and not documented" \
		tests/page $$(grep -rl 'pytest.mark.long' tests --include='test_*.py')

fixed-searches:
	+$(TESTS) tests.searches

check-all: postgresql firefox $(VENV)/.crosschecks static
	$(SIDE) all-tests fresh-searches container-steps crosschecks
	$(TESTS) tests.searches requests --minutes 3
	$(BIN)/python -m tests.crosschecks.check_firefox

all-tests:
	+$(PYTEST) $(MORE) --hypothesis-profile=fresh-cases

fresh-searches:
	+$(TESTS) tests.searches --minutes $(MINUTES)

# the simple model of flight beside somebody else's vehicles, in wind and gusts. Two trials, the same
# each day: one by one they may differ by half, where a vehicle sees another a sample later
crosschecks: $(VENV)/.crosschecks
	$(BIN)/python -m tests.crosschecks.check_plants 2 1 --air gusts --readings measured $(COURSES)

# only the long tests start a PostgreSQL of their own
postgresql:
	@command -v initdb >/dev/null || ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 || \
		{ echo "the long tests need PostgreSQL's initdb: apt-get install postgresql" >&2; exit 1; }

# tests look at the web page in a browser
chromium:
	@command -v chromium chromium-browser google-chrome chrome >/dev/null || \
		[ -n "$$SYNCPLAN_CHROMIUM" ] || \
		{ echo "the tests need Chromium: apt-get install chromium" >&2; exit 1; }

# only check-all looks at the page in another browser
firefox:
	@command -v firefox-esr firefox >/dev/null || \
		{ echo "make check-all needs Firefox: apt-get install firefox-esr" >&2; exit 1; }

docs: $(VENV)/.docs
	$(BIN)/python -m docs.site

# kernels of large teams take longer still, and nothing here uses them
container-steps:
	docker/steps.sh small

benchmarks: $(VENV)/.dev
	$(call install,'.[bench]')
	$(BIN)/python -m benchmarks

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "syncplan needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: $(BIN)/python pyproject.toml requirements.lock
	$(call install,.)
	touch $@

$(VENV)/.api: $(BIN)/python pyproject.toml requirements.lock
	$(call install,'.[api]')
	touch $@ $(VENV)/.run

$(VENV)/.dev: $(BIN)/python pyproject.toml requirements.lock
	$(call install,'.[dev]')
	touch $@ $(VENV)/.api $(VENV)/.run

# no dependencies of the project; what they ask for beside NumPy and SciPy is not used
$(VENV)/.crosschecks: $(VENV)/.dev tests/crosschecks/requirements.txt
	$(BIN)/pip install --quiet --no-deps --require-hashes \
		--requirement tests/crosschecks/requirements.txt
	touch $@

# what checks and bundles the scripts of the web page
$(VENV)/.page: $(VENV)/.dev vendor/package.json vendor/package-lock.json
	PATH="$(abspath $(BIN)):$$PATH" npm ci --prefix vendor --silent --no-audit --no-fund
	touch $@

$(VENV)/.docs: $(BIN)/python pyproject.toml requirements.lock
	$(call install,'.[api,client,docs]')
	touch $@ $(VENV)/.api $(VENV)/.run

# what builds the project is locked too
BUILD   := 'hatchling>=1.26,<2' 'editables>=0.5,<1'
compile = $(BIN)/uv pip compile --quiet --no-header --no-annotate --no-emit-index-url --no-emit-find-links \
	--generate-hashes --python-version 3.11 --output-file $(1) $(2) pyproject.toml -

lock: $(BIN)/python
	$(BIN)/pip install --quiet $(UV)
	printf '%s\n' $(BUILD) $(UV) | $(call compile,requirements.lock,--all-extras)
	cp requirements.lock docker/service.lock
	printf '%s\n' $(BUILD) | $(call compile,docker/service.lock,--extra telemetry)
	printf '%s\n' 'rotorpy>=3.0,<3.1' 'jsbsim>=1.3,<1.4' | $(BIN)/uv pip compile --quiet --no-deps \
		--no-header --no-annotate --no-emit-index-url --no-emit-find-links --generate-hashes \
		--python-version 3.11 --output-file tests/crosschecks/requirements.txt -

clean:
	rm -rf $(VENV) .import_linter_cache .mypy_cache .pytest_cache .ruff_cache .hypothesis .schemathesis build dist
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
