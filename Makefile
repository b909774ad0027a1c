# Plain `make` sets up .venv with `rayfarm` in it; `make run` and `make test` do so first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check -q install -c constraints.txt
ARGS ?=

.PHONY: all run agent phone phone-compiler test test-api test-chaos test-soak check docs benchmark clean

all: $(VENV)/.ready

run: $(VENV)/.ready
	$(BIN)/rayfarm up $(ARGS)

# What runs on a phone: agent_android/build/agent.jar and agent.apk.
agent: $(VENV)/.ready
	tools/system_packages.sh agent
	$(BIN)/python -m agent_android.build

# A phone made of adbd and this machine's llvmpipe; `make phone ARGS='--count 2'` makes two.
phone: $(VENV)/.ready-to-test
	$(BIN)/python -m agent_android.build desktop
	$(BIN)/python -m agent_android.standin $(ARGS)

# Mesa's compilers for phone GPUs, for `rayfarm compile`: about 16 CPU minutes, from Debian's source package.
phone-compiler:
	PYTHON=$(PYTHON) tools/phone_compiler.sh

# Everything, one file more at once than there are cores, as many tests wait for others' clocks;
# `make test ARGS=tests/unit/test_plan.py` runs what is named.
test: $(VENV)/.ready-to-test
	$(MAKE) check
	$(BIN)/python -m agent_android.build desktop
	$(BIN)/pytest $(or $(ARGS),-n $(shell expr $$(nproc) + 1) --dist loadfile --no-loadscope-reorder)

# At least 10,000 made-up requests to the whole API.
test-api: $(VENV)/.ready-to-test
	$(BIN)/pytest -m long tests/acceptance/test_service_schema.py $(ARGS)

# Minutes of killed and frozen workers, on SQLite and PostgreSQL.
test-chaos: $(VENV)/.ready-to-test
	$(BIN)/pytest -s -m long tests/chaos $(ARGS)

# An hour of jobs on a whole farm; `make test-soak ARGS='--minutes 10'` is shorter.
test-soak: $(VENV)/.ready-to-test
	$(BIN)/python -m agent_android.build desktop
	$(BIN)/pytest -s -m long tests/phones/test_soak.py $(ARGS)

check: $(VENV)/.ready-to-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The documentation as a site: var/docs/docs/index.html.
docs: $(VENV)/.ready
	$(PIP) --no-build-isolation -e '.[docs]'
	$(BIN)/python -m sphinx -W -n -q -j auto -c docs . var/docs

benchmark: $(VENV)/.ready-to-test
	$(BIN)/python -m benchmarks.builders
	$(BIN)/python -m benchmarks.traversals $(ARGS)

clean:
	rm -rf $(VENV) var build dist *.egg-info agent_android/build

$(VENV)/.ready: pyproject.toml constraints.txt tools/system_packages.sh
	tools/system_packages.sh run
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and 'RayFarm needs Python 3.11 or later: make PYTHON=python3.11')"
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) pip setuptools
	$(PIP) --no-build-isolation -e .
	touch $@

$(VENV)/.ready-to-test: $(VENV)/.ready
	tools/system_packages.sh test
	$(PIP) --no-build-isolation -e '.[test,docs]'
	touch $@
