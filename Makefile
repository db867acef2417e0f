# Everything a fresh Linux machine needs: Python 3.11 or 3.13 (the Pythons that pip's bpy, Blender as a module, is built
# for), pip and make. Each target makes what it needs, alone, in any order, and again at no cost.
#
#   make demo PYTHON=/opt/python3.11/bin/python3

SHELL := /bin/sh
.DEFAULT_GOAL := help
# Two installs into one environment must not run at once, even with make -j.
.NOTPARALLEL:

VENV ?= .venv
VENV_OLDEST := $(VENV)-bpy-4.5
RUN := $(VENV)/bin/python
PIP_INSTALL := -m pip install --quiet --disable-pip-version-check
OUTPUT ?= output
PLATFORM ?=
# Every process would compile all modules anew, which takes it a second.
unexport PYTHONDONTWRITEBYTECODE
# Generations of GPUs to compile kernels for: all, unless it is set (GPUS="75 80 90"), to nothing for none.
GPUS_OPTION := $(if $(filter undefined,$(origin GPUS)),,--gpus $(GPUS))
# Kinds of processors to compile the extension's kernels for: all, unless it is set (TIERS=native for this machine's).
TIERS_OPTION := $(if $(TIERS),--tiers $(TIERS))
SCENES ?= 10
TREES ?= 10000000
PLANET_ARGS ?=
PYTEST_ARGS ?=
# Files of tests are handed to several processes, one more than processors, since some tests wait; each takes a gigabyte or two.
PROCESSORS := $(or $(shell getconf _NPROCESSORS_ONLN 2>/dev/null),1)
TEST_PROCESSES ?= --numprocesses $(shell expr $(PROCESSORS) + 1) --maxprocesses 4 --dist loadfile --no-loadscope-reorder
BENCH_ARGS ?=
FUZZ_SECONDS ?= 600
FUZZ_SEED ?= 0

# The first of these that runs and that has a bpy wheel; with PYTHON=…, only that one.
PYTHON ?=
CANDIDATES := $(if $(PYTHON),$(PYTHON),python3 python3.11 python3.13 python)
FOUND := $(shell for p in $(CANDIDATES); do \
	v=$$($$p -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) || continue; \
	case $$v in (3.11|3.13) echo $$p $$v; exit;; esac; done)
CHOSEN := $(word 1,$(FOUND))
VERSION := $(or $(word 2,$(FOUND)),none)

.PHONY: help demo pizza meadow beach crowd portrait doughnut rocks boat dataset planet figures bench test fuzz walk extension repository wheel docs lint format clean

help: ## Say what can be made
	@echo "make demo       build, scatter and render the forest into $(OUTPUT)/"
	@echo "make pizza      model, scatter and render four pizzas into $(OUTPUT)/"
	@echo "make meadow     flowers and grass on both sides of a path; make beach: pebbles around driftwood; into $(OUTPUT)/"
	@echo "make crowd      people on a square who look at a stage; make portrait: a photograph in buttons; into $(OUTPUT)/"
	@echo "make doughnut   scatter sprinkles on a doughnut; make rocks: moss on rocks; make boat: barnacles under a boat; into $(OUTPUT)/"
	@echo "make dataset    render SCENES=10 scenes with masks, depth and boxes into $(OUTPUT)/dataset/"
	@echo "make planet     place TREES=10000000 trees on the Earth, and draw them from orbit down to one: $(OUTPUT)/planet.jpg"
	@echo "make figures    recompute the experiments of the paper: pictures and a table in $(OUTPUT)/figures/"
	@echo "make bench      time everything, beside other libraries: $(OUTPUT)/bench.md"
	@echo "make test       run the tests, in Blender $(if $(filter 3.11,$(VERSION)),5.0 and 4.5,as a Python module)"
	@echo "make walk       use the sidebar in any order for ten minutes (FUZZ_SEED=…)"
	@echo "make fuzz       solve recipes of all kinds for ten minutes, and look at what comes of them (FUZZ_SEED=…)"
	@echo "make extension  build the installable zip into dist/ (PLATFORM=linux-x64, windows-x64 or macos-arm64)"
	@echo "make repository build the zips of all platforms (or of PLATFORM) and their list for Blender into dist/repository/"
	@echo "make wheel      build what pip installs into dist/, and check it"
	@echo "make docs       build the documentation as web pages into $(OUTPUT)/docs/"
	@echo "make lint       check style and types"
	@echo "make format     put the code into the style that lint asks for"
	@echo "make clean      remove everything that was made here"
	@echo
	@echo "PYTHON=…        the Python to use: 3.11 or 3.13 (now: $(or $(CHOSEN),none found))"

demo: $(VENV)/.with-blender
	$(RUN) demo_scenes/forest.py --output $(OUTPUT)

pizza: $(VENV)/.with-blender
	$(RUN) demo_scenes/pizza.py --output $(OUTPUT)

meadow beach crowd portrait: $(VENV)/.with-blender
	$(RUN) demo_scenes/$@.py --output $(OUTPUT)

doughnut rocks boat: $(VENV)/.with-blender
	$(RUN) demo_scenes/surfaces.py $@ --output $(OUTPUT)

dataset: $(VENV)/.with-blender
	$(RUN) demo_scenes/dataset.py --output $(OUTPUT)/dataset --scenes $(SCENES)

# PLANET_ARGS=--quick makes a small one.
planet: $(VENV)/.with-planet
	$(RUN) demo_scenes/planet.py --output $(OUTPUT) --trees $(TREES) $(PLANET_ARGS)

figures: $(VENV)/.with-test
	$(RUN) benchmarks/figures.py --output $(OUTPUT)/figures

# fmm2dpy needs NumPy 1, so it has an environment of its own; without it (no compiler, no wheel) its columns stay empty.
bench: $(VENV)/.with-blender $(VENV)/.with-test $(VENV)/.with-bench $(VENV)-fmm/.python-$(VERSION)
	@$(VENV)-fmm/bin/python $(PIP_INSTALL) 'numpy<2' fmm2dpy finufft || echo "fmm2dpy and finufft cannot be installed here"
	$(RUN) benchmarks/bench.py --output $(OUTPUT)/bench.md $(BENCH_ARGS) \
		$$($(VENV)-fmm/bin/python -c 'import finufft, fmm2dpy; print("--fmm $(VENV)-fmm/bin/python")' 2>/dev/null)

test: $(VENV)/.with-blender $(VENV)/.with-test $(VENV)/.with-ray $(VENV)/.with-geo $(if $(filter 3.11,$(VERSION)),$(VENV_OLDEST)/.with-oldest)
	@$(RUN) tools/warm_kernels.py
	$(RUN) -m pytest $(TEST_PROCESSES) $(PYTEST_ARGS)
ifeq ($(VERSION),3.11)
	@echo "The part that touches Blender once more, in the oldest that is supported:"
	$(VENV_OLDEST)/bin/python -m pytest tests/esh_scatter tests/test_extension_zip.py -m "not once" $(TEST_PROCESSES) $(PYTEST_ARGS)
endif

fuzz: $(VENV)/.with-test
	$(RUN) tools/fuzz.py --seconds $(FUZZ_SECONDS) --seed $(FUZZ_SEED)

walk: $(VENV)/.with-blender
	$(RUN) tests/esh_scatter/sidebar_walk.py --seconds $(FUZZ_SECONDS) --seed $(FUZZ_SEED)

extension: $(VENV)/.with-blender
	@$(RUN) tools/build_extension.py $(if $(PLATFORM),--platform $(PLATFORM)) $(GPUS_OPTION) $(TIERS_OPTION)

# A folder that any web server can host: Blender installs and updates from it.
repository: $(VENV)/.with-blender
	@$(RUN) tools/build_repository.py $(if $(PLATFORM),--platform $(PLATFORM)) $(GPUS_OPTION)

wheel: $(VENV)/.with-release
	rm -f dist/*.whl dist/*.tar.gz
	$(RUN) -m build --outdir dist
	$(RUN) tools/build_wheel.py dist/*-py3-none-any.whl $(GPUS_OPTION)
	$(RUN) -m twine check --strict dist/*.whl dist/*.tar.gz

# Nothing is downloaded once Sphinx is installed; a warning is an error.
docs: $(VENV)/.with-docs
	$(RUN) -m sphinx --fail-on-warning --keep-going --quiet -d build/doctrees docs $(OUTPUT)/docs
	@echo "$(OUTPUT)/docs/index.html"

lint: $(VENV)/.with-lint
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) tools/check_types.py

format: $(VENV)/.with-lint
	$(RUN) -m ruff check --fix .
	$(RUN) -m ruff format .

clean:
	rm -rf $(VENV) $(VENV_OLDEST) $(VENV)-fmm build dist $(OUTPUT) *.egg-info

# One stamp for the environment, and one for each set of packages in it; a new pyproject.toml installs anew.
$(VENV)/.with-%: pyproject.toml $(VENV)/.python-$(VERSION)
	@echo "Installing into $(VENV): esh-scatter with what '$*' needs ..."
	@$(RUN) $(PIP_INSTALL) --editable '.[$*]'
	@case $* in blender) $(RUN) tools/check_bpy.py;; esac
	@touch $@

$(VENV_OLDEST)/.with-oldest: pyproject.toml $(VENV_OLDEST)/.python-$(VERSION)
	@echo "Installing into $(VENV_OLDEST): esh-scatter with the oldest Blender supported ..."
	@$(VENV_OLDEST)/bin/python $(PIP_INSTALL) --editable '.[blender-oldest,test]'
	@$(VENV_OLDEST)/bin/python tools/check_bpy.py
	@touch $@

# An environment of another Python is made anew. Debian's Python comes without ensurepip, but pip can serve itself.
$(VENV)/.python-$(VERSION) $(VENV_OLDEST)/.python-$(VERSION) $(VENV)-fmm/.python-$(VERSION):
	@if [ $(VERSION) = none ]; then \
		echo "Python 3.11 or 3.13 is needed (pip's bpy is built for these only), and none of '$(CANDIDATES)' is one: say which to use with PYTHON=…, for example make demo PYTHON=/usr/bin/python3.11" >&2; exit 1; fi
	@rm -rf $(@D)
	@if $(CHOSEN) -c 'import venv, ensurepip' 2>/dev/null; then $(CHOSEN) -m venv $(@D); \
	elif $(CHOSEN) -c 'import venv' 2>/dev/null && $(CHOSEN) -m venv --without-pip $(@D) \
		&& $(CHOSEN) -m pip --quiet --python $(@D)/bin/python install pip 2>/dev/null; then :; \
	else rm -rf $(@D); \
		echo "$(CHOSEN) cannot make virtual environments: install its venv module (on Debian and Ubuntu: apt install python$(VERSION)-venv)" >&2; exit 1; fi
	@touch $@
