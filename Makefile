# make demo    install, try the network of the package, then generate, train and evaluate a small one: outputs/demo
# make teach   install, then open the dance teacher in the browser
# make test    install, then run the tests
# make speed   install, then measure speeds: outputs/speed.json
# make fuzz    install, then find planted faults, and read 2,000 mutations of every file format that strangers send
# make kill    install, then find planted faults, and kill each program 50 times, or its power, and compare what it makes
# make soak    install, then run the online path for an hour
# make dependencies   run some tests with the lowest and with the newest allowed version of each dependency
# make lint    install, then check style, format and types
# make results ROW=eval_sim_31   install, then measure a row of results/ again: results/eval_sim_31.json
# make wheel   install, then build dist/*.whl
# make release VERSION=0.2.0   write a new version everywhere, build and try its wheel, and say what is left to do
# make clean   remove the environment and caches; what was generated and trained stays

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/installed
DEMO := outputs/demo

.PHONY: demo teach test speed fuzz kill soak dependencies lint results wheel release clean

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "kpopnet needs Python 3.11 or newer; say which: make PYTHON=/path/to/python3.12"; exit 1; }
	$(BIN)/python -m pip --version >/dev/null 2>&1 || { rm -rf .venv && $(PYTHON) -m venv .venv; } || { rm -rf .venv; \
		echo "$(PYTHON) cannot make an environment with pip in it; on Debian: apt-get install python3-venv"; exit 1; }
	$(BIN)/python -m pip install --disable-pip-version-check --constraint constraints.txt --editable '.[dev,cluster,gl,app]'
	touch $@

demo: $(READY)
	rm -rf $(DEMO)
	$(BIN)/python -m synth benchmark=eval_sim benchmark.sequences=1 out=data/demo/eval_sim
	$(BIN)/python evaluate.py benchmark=eval_sim benchmark.path=data/demo/eval_sim 'estimator=[best]' hydra.run.dir=$(DEMO)/shipped
	$(BIN)/python -m synth preset=demo
	$(BIN)/python train.py data.train=data/demo/train data.validation=data/demo/validation \
		training=demo model.crop_px=64 hydra.run.dir=$(DEMO)/training
	$(BIN)/python evaluate.py checkpoint=$(DEMO)/training/best benchmark.path=data/demo/test hydra.run.dir=$(DEMO)

teach: $(READY)
	$(BIN)/kpopnet teach

# One process more than cores, as some tests wait, with a thread each; more would compile more kernels twice. The programs that tests
# start share their bytecode, also where an image keeps none.
test: $(READY)
	PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 $(BIN)/python -m pytest --dist loadfile --no-loadscope-reorder \
		--numprocesses $$($(BIN)/python -c 'from kpopnet.runtime.cpu import available_cores; print(min(available_cores() + 1, 4))')

speed: $(READY)
	$(BIN)/python -m tests.speed

fuzz: $(READY)
	$(BIN)/python -m tests.fuzz --planted
	$(BIN)/python -m tests.fuzz

kill: $(READY)
	$(BIN)/python -m tests.kill --planted
	$(BIN)/python -m tests.kill

soak: $(READY)
	$(BIN)/python -m tests.soak

dependencies:
	$(PYTHON) tools/check_dependencies.py lowest newest

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	@if command -v eslint >/dev/null; then eslint; else echo "the page's modules are not linted: npm install --global eslint"; fi

results: $(READY)
	$(BIN)/python tools/results.py make $(ROW)

wheel: $(READY)
	$(BIN)/python -m pip wheel --disable-pip-version-check --no-deps --wheel-dir dist .

release: $(READY)
	PYTHONPATH=. $(BIN)/python tools/release.py $(VERSION)

clean:
	rm -rf .venv .pytest_cache .hypothesis .ruff_cache *.egg-info build dist
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
