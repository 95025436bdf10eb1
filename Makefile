# `make run` and `make test` do their own set-up, once. They need Python 3.11 or newer and make, nothing else.
PYTHON ?= python3
BIN := .venv/bin
# What runs and tests need. The tests do without the hub and, where it is not installed, without Open3D.
EXTRAS := train,simulate,report,pcd,las,cluster,onnx

# `make test PROCESSOR=sse` computes as an older processor does: torch, oneDNN, MKL and OpenBLAS each by the instruction set named.
# avx512 takes a processor that has it. Without PROCESSOR each library takes the best that it finds.
sse := ATEN_CPU_CAPABILITY=default ONEDNN_MAX_CPU_ISA=SSE41 MKL_CBWR=COMPATIBLE OPENBLAS_CORETYPE=Nehalem
avx2 := ATEN_CPU_CAPABILITY=avx2 ONEDNN_MAX_CPU_ISA=AVX2 OPENBLAS_CORETYPE=Haswell
avx512 := ATEN_CPU_CAPABILITY=avx512 ONEDNN_MAX_CPU_ISA=AVX512_CORE OPENBLAS_CORETYPE=SkylakeX
NUMERIC := tests/benchmarks tests/geometry tests/grafting tests/metrics tests/plugins tests/testing tests/upsample \
	$(patsubst %,tests/test_%.py,evaluation export library measure model train)

.PHONY: run test test-numeric check bench clean

run: .venv/.installed
	$(BIN)/pcsr run pretrained

test: .venv/.installed
	$($(PROCESSOR)) $(BIN)/python -m pytest --numprocesses auto --dist loadfile $(ARGS)

# What may depend on the last bits of a processor's arithmetic.
test-numeric:
	$(MAKE) test PROCESSOR=$(PROCESSOR) ARGS="$(NUMERIC) $(ARGS)"

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
