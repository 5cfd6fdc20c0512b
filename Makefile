# make demo: the detector over the recorded bag; make test: the checks and the tests.
# Both need Python 3.10 or newer and the network, and put everything into .venv.

VENV ?= .venv
# The first that is new enough is taken.
PYTHON ?= python3 python3.13 python3.12 python3.11 python3.10
DEMO := demo

# A sourced ROS comes before its wheels, which are for Linux on x86-64; without either, the tests
# that need ROS are skipped.
ifeq ($(ROS_DISTRO)$(shell uname -sm),Linux x86_64)
EXTRAS ?= ros,test
else
EXTRAS ?= test
endif

BIN := $(VENV)/bin
INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-input
METADATA := setup.py setup.cfg pyproject.toml

# The ROS wheels set it for one environment; inherited from another one, it breaks this one.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

.PHONY: demo test lint environment clean

demo: $(VENV)/.installed
	$(BIN)/rover-obstacles replay bags/mars_yard --output $(DEMO) --images --force
	@echo
	@echo 'The pictures are in $(DEMO)/images. To look at first: the overlays,'
	@ls $(DEMO)/images/*overlay* | sed 's/^/  /'

test: lint
	$(BIN)/python -m pytest

lint: environment
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@# The newest NumPy for Python 3.10 has other types than those checked against.
	@if $(BIN)/python -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then \
		echo $(BIN)/mypy && $(BIN)/mypy; \
	else \
		echo 'mypy is not run: it needs Python 3.11 or newer'; \
	fi

environment: $(VENV)/.installed-$(EXTRAS)

clean:
	rm -rf .venv .venv-* $(DEMO) build install log *.egg-info \
		.mypy_cache .pytest_cache .ruff_cache .hypothesis

$(VENV)/.installed: $(METADATA) | $(VENV)/.made
	@echo 'Installing into $(VENV), about half a minute ...'
	@$(INSTALL) --editable .
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
		echo 'Python 3.10 or newer is needed, none was found under: $(PYTHON)' >&2; \
		echo 'python3 is: '"$$(python3 --version 2>&1)" >&2; \
		echo 'With one elsewhere: make PYTHON=/path/to/python3.12 ...' >&2; \
		exit 1; \
	fi; \
	if ! "$$python" -c 'import ensurepip, venv' 2>/dev/null; then \
		echo "$$python cannot make virtual environments: its venv module is missing." >&2; \
		echo 'On Debian and Ubuntu: sudo apt-get install python3-venv' >&2; \
		exit 1; \
	fi; \
	"$$python" -m venv $(VENV)
	@touch $@
