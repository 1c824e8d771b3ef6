# Each target sets up .venv first, from a clean clone too, and again only when pyproject.toml changes.
# PYTHON names the interpreter (3.11 or newer) to set it up with; VENV another place for it.

VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test lint bench setup
.DELETE_ON_ERROR:

demo: $(READY)
	mkdir -p demo
	$(BIN)/recon build samples/corridor -o demo/corridor.usd -o demo/corridor.glb -o demo/corridor.dxf --work demo/corridor.recon

test: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

bench: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/build.py samples/corridor

setup: $(READY)

$(READY): pyproject.toml .ci/setup
	.ci/setup $(VENV)
	touch $@
