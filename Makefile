# make demo: run the detector on a recorded bag. make test: run lint, type checks and tests.
# make coverage: run the tests and report the lines and branches that they reach.
# All need Python 3.10 or newer and network access, and install into .venv.

VENV ?= .venv
# The first one that is new enough.
PYTHON ?= python3 python3.13 python3.12 python3.11 python3.10
DEMO := demo

# A sourced ROS takes precedence over the ROS wheels, which exist for Linux on x86-64 only.
# Without either, the tests that need ROS are skipped.
ifeq ($(ROS_DISTRO)$(shell uname -sm),Linux x86_64)
EXTRAS ?= ros,fast,test
else
EXTRAS ?= fast,test
endif

BIN := $(VENV)/bin
INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-input
METADATA := setup.py setup.cfg pyproject.toml

# The ROS wheels set it per environment; a value inherited from another one breaks this one.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

.PHONY: demo test coverage lint environment clean

demo: $(VENV)/.installed
	$(BIN)/rover-obstacles replay bags/mars_yard --output $(DEMO) --images --force
	@echo
	@echo 'Pictures are in $(DEMO)/images. Start with the overlays:'
	@ls $(DEMO)/images/*overlay* | sed 's/^/  /'

test: lint
	$(BIN)/python -m pytest --numprocesses auto --dist loadgroup

coverage: environment
	$(BIN)/coverage erase
	@# The report is wanted even if a test fails.
	$(BIN)/coverage run -m pytest --numprocesses auto --dist loadgroup; status=$$?; \
		$(BIN)/coverage combine --quiet && $(BIN)/coverage report && exit $$status

lint: environment
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@# On Python 3.10 the newest NumPy has type annotations that differ from those checked.
	@if $(BIN)/python -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then \
		echo $(BIN)/mypy && $(BIN)/mypy; \
	else \
		echo 'mypy skipped: it needs Python 3.11 or newer'; \
	fi

environment: $(VENV)/.installed-$(EXTRAS)

clean:
	rm -rf .venv .venv-* $(DEMO) build install log *.egg-info \
		.mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage .coverage.*

$(VENV)/.installed: $(METADATA) | $(VENV)/.made
	@echo 'Installing into $(VENV), about a minute ...'
	@$(INSTALL) --editable '.[fast]'
	@touch $@

$(VENV)/.installed-$(EXTRAS): $(METADATA) | $(VENV)/.made
	@echo 'Installing with [$(EXTRAS)] into $(VENV), about a minute ...'
	@$(INSTALL) --editable '.[$(EXTRAS)]'
	@touch $(VENV)/.installed $@

$(VENV)/.made:
	@for python in $(PYTHON); do \
		"$$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null && break; \
		python=; \
	done; \
	if [ -z "$$python" ]; then \
		echo 'Python 3.10 or newer is required. None of these is: $(PYTHON)' >&2; \
		echo 'python3 is '"$$(python3 --version 2>&1)" >&2; \
		echo 'To use another one: make PYTHON=/path/to/python3.12 ...' >&2; \
		exit 1; \
	fi; \
	if ! "$$python" -c 'import ensurepip, venv' 2>/dev/null; then \
		echo "$$python cannot create virtual environments: its venv module is missing." >&2; \
		echo 'On Debian and Ubuntu: sudo apt-get install python3-venv' >&2; \
		exit 1; \
	fi; \
	"$$python" -m venv $(VENV)
	@touch $@
