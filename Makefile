# `make run` and `make test` do their own set-up, once. They need Python 3.11 or newer and make, nothing else.
PYTHON ?= python3
BIN := .venv/bin
# What runs and tests need. The tests do without the hub and, where it is not installed, without Open3D.
EXTRAS := train,simulate,report,pcd,las,e57,ros,cluster,onnx

# `make test PROCESSOR=sse` computes as an older processor does: torch, oneDNN, MKL and OpenBLAS each by the instruction set named.
# avx512 takes a processor that has it. Without PROCESSOR each library takes the best that it finds.
sse := ATEN_CPU_CAPABILITY=default ONEDNN_MAX_CPU_ISA=SSE41 MKL_CBWR=COMPATIBLE OPENBLAS_CORETYPE=Nehalem
avx2 := ATEN_CPU_CAPABILITY=avx2 ONEDNN_MAX_CPU_ISA=AVX2 OPENBLAS_CORETYPE=Haswell
avx512 := ATEN_CPU_CAPABILITY=avx512 ONEDNN_MAX_CPU_ISA=AVX512_CORE OPENBLAS_CORETYPE=SkylakeX
NUMERIC := $(patsubst %,tests/%,benchmarks experiments geometry grafting metrics network plugins registration sensors testing upsample \
	test_export.py test_model.py)
PAGES := $(wildcard *.md docs/*.md docs/*/*.md)
COG := $(BIN)/cog --verbosity=1 -U -I docs -p "import tables"

.PHONY: run test test-numeric check pages docs bench clean

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
	$(COG) --check $(PAGES)

# Fills in the tables of the pages: docs/tables.py.
pages: .venv/.installed
	$(COG) -r $(PAGES)

# The site, in site/.
docs: .venv/.installed
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	! grep -rlE "(src|href)=\"https?:[^\"]*\.(js|css)" site --include=*.html

bench: .venv/.installed
	JAXTYPING_DISABLE=1 PYTHONPATH=benchmarks $(BIN)/python -m pytest $(or $(ARGS),benchmarks) --benchmark-columns=mean,stddev,rounds --benchmark-verbose --benchmark-min-rounds=3

# pip 25.1 is the first that reads [dependency-groups].
.venv/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --constraint constraints.txt --editable '.[$(EXTRAS)]' --group dev --group docs
	touch $@

clean:
	rm -rf .venv runs
