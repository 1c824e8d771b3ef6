# Each target sets up .venv first, from a clean clone too, and again only when pyproject.toml changes.
# PYTHON names the interpreter (3.11 or newer) to set it up with; VENV another place for it; DRIVES more folders to bench.

VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
DRIVES ?=

.PHONY: demo test lint bench setup
.DELETE_ON_ERROR:

demo: $(READY)
	mkdir -p demo
	$(BIN)/recon build samples/corridor -o demo/corridor.usd -o demo/corridor.glb -o demo/corridor.dxf --work demo/corridor.recon

test: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadgroup

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

bench: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/build.py samples/corridor
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/texturing.py samples/corridor --images 43 200
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/accuracy.py samples/corridor $(DRIVES) --buildings 8
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/layout.py --buildings 20
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/uncertainty.py samples/corridor --buildings 6
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/filter_vs_graph.py samples/corridor $(DRIVES) --simulated 3
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/scale.py --most 10000

setup: $(READY)

$(READY): pyproject.toml .ci/setup
	.ci/setup $(VENV)
	touch $@
