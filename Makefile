# `make run` and `make test` do their own set-up, once. They need Python 3.11 or newer and make, nothing else.
PYTHON ?= python3
BIN := .venv/bin
# What runs and tests need. The tests do without the hub and, where it is not installed, without Open3D.
EXTRAS := train,simulate,report,pcd,las,cluster,onnx

.PHONY: run test check bench clean

run: .venv/.installed
	$(BIN)/pcsr run recipes/pretrained.yaml

test: .venv/.installed
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile $(ARGS)

check: .venv/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: .venv/.installed
	JAXTYPING_DISABLE=1 PYTHONPATH=benchmarks $(BIN)/python -m pytest $(or $(ARGS),benchmarks) --benchmark-columns=mean,stddev,rounds --benchmark-verbose --benchmark-min-rounds=3

# pip 25.1 is the first that reads [dependency-groups].
.venv/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --constraint constraints.txt --editable '.[$(EXTRAS)]' --group dev
	touch $@

clean:
	rm -rf .venv runs
