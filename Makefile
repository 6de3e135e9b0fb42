# Partita. `make demo` and `make test` are all a newcomer needs; each sets up what it uses in .venv by itself.

PYTHON ?= python3
BIN := .venv/bin
# One line for each long step; VERBOSE=1 shows what it prints.
QUIETLY = @$(PYTHON) tools/quietly.py
TOOLS := .venv/.tools
BUILT := .venv/.built
FMU := .venv/.fmu
WEB := .venv/.web
SITE := .venv/.site
PACKING := .venv/.packing

# Everything that the native module is made of.
RUST := Cargo.toml Cargo.lock $(shell find crates -name '*.rs' -o -name 'Cargo.toml')

export VIRTUAL_ENV := $(CURDIR)/.venv
export PYO3_PYTHON := $(CURDIR)/.venv/bin/python
export PIP_CONSTRAINT := $(CURDIR)/constraints.txt
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export MPLBACKEND ?= Agg
# Packages are installed without bytecode. Where the environment forbids to write it, each of the processes that tests
# start would compile NumPy and all else anew; empty, the first one keeps what it compiled.
export PYTHONDONTWRITEBYTECODE :=

.DEFAULT_GOAL := all
.DELETE_ON_ERROR:
.PHONY: all install install-check fmu format lint test test-rust test-python trust errors bench docs compare-docs demo paper clean

## all: check, test, show and document everything
all: lint test demo docs

## install: .venv with the pinned tools and Partita itself, its core built for speed
install: $(BUILT)

$(TOOLS): constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
		{ echo "Partita needs Python 3.10 or newer; name one: make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 1; }
	@command -v cargo >/dev/null || { echo "Partita's core is written in Rust: install Rust 1.85 or newer" >&2; exit 1; }
	$(QUIETLY) "Making .venv" "some seconds" $(PYTHON) -m venv .venv
	$(QUIETLY) "Installing the pinned tools into it" "a minute, by network" \
		$(BIN)/python -m pip install --no-compile --only-binary=:all: --requirement constraints.txt
	@touch $@

$(BUILT): $(TOOLS) pyproject.toml $(RUST)
	$(QUIETLY) "Compiling the core and installing Partita" "four minutes on two cores, once" \
		$(BIN)/maturin develop --release --locked
	@touch $@

# The binary inside FMUs, put beside the Python sources. Asked for by way of its test, cargo takes the core that the other
# tests stand on; asked for alone, it would compile all of it again with fewer features.
FMU_LIBRARY = $(wildcard $(addprefix $(or $(CARGO_TARGET_DIR),target)/release/deps/,libpartita_fmu.so libpartita_fmu.dylib partita_fmu.dll))

$(FMU): $(TOOLS) $(RUST)
	$(QUIETLY) "Compiling the binary inside FMUs" "a minute, once" \
		cargo build --release --workspace --test fmu_wall --locked
	@$(MAKE) --no-print-directory put-fmu
	@touch $@

.PHONY: put-fmu
put-fmu:
	@mkdir -p python/partita/_fmu
	@cp $(FMU_LIBRARY) LICENSE-* python/partita/_fmu/

## fmu: the binary inside FMUs; a wheel that is made afterwards holds it
fmu: $(FMU)

# The core inside pages, where Rust can compile for them.
$(WEB): $(TOOLS) $(RUST)
	$(QUIETLY) "Compiling the core for pages" "three minutes on two cores, once" $(BIN)/python tools/web_module.py
	@touch $@

## web: the core inside pages that compute without Python; needs Rust's target wasm32-unknown-unknown
.PHONY: web
web: $(WEB)

## format: rewrite the sources in the house style
format: $(TOOLS)
	cargo fmt --all
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

## lint: style, types and lints; a warning is an error
lint: $(TOOLS)
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --locked -- -D warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy examples benches tools

## test: the core, then the package with its docstrings' examples
test: test-rust test-python

test-rust: $(TOOLS)
	cargo test --release --workspace --locked

test-python: $(BUILT) $(FMU)
	$(BIN)/python -m pytest

## trust: N=5000 mechanisms of every element, couplings, sensors, files and FMUs drawn by chance against independent programs; as many everyday drawings, and what must not matter to them; RUNS=2000 keep their branch; verdicts; kinks; runs of segments by brute force; contacts; chains; platforms; misdrawn loops beside couplings; the zoo and its linearised equations; in full what `make test` looks at in part
N ?= 5000
RUNS ?= 2000
trust: $(BUILT) $(WEB)
	$(BIN)/python -m pytest -q tests/python/test_static_page.py
	PYTHONPATH=tests/python $(BIN)/python -m oracle $(N)
	PYTHONPATH=tests/python $(BIN)/python -m everyday $(N)
	PYTHONPATH=tests/python $(BIN)/python -m branches $(RUNS)
	PYTHONPATH=tests/python $(BIN)/python -m verdicts 1000
	PYTHONPATH=tests/python $(BIN)/python -m kinks 2000
	PYTHONPATH=tests/python $(BIN)/python -m holding 300
	PYTHONPATH=tests/python $(BIN)/python -m contacts 1000
	PYTHONPATH=tests/python $(BIN)/python -m chains
	PYTHONPATH=tests/python $(BIN)/python -m geometry_study platforms
	PYTHONPATH=tests/python $(BIN)/python -m geometry_study touching
	PYTHONPATH=tests/python $(BIN)/python -m zoo
	PYTHONPATH=tests/python $(BIN)/python -m derivatives
	$(BIN)/python tests/python/damaged.py --count 1200
	PARTITA_THOROUGH=1 $(BIN)/python -m pytest tests/python

## processors: all tests with instructions held to SSE2, AVX2, AVX-512, and with drawings moved by one unit in their last place (ONLY="sse2 moved-1" some of it)
.PHONY: processors
processors: $(BUILT) $(FMU)
	$(BIN)/python tools/processors/suite.py $(ONLY)

## pages: animated pages of the whole catalogue opened in Chromium, desktop and phone, light and dark; pictures in out/pages
.PHONY: pages
pages: $(BUILT)
	$(BIN)/python tests/python/test_pages.py

## picture: the moving picture at the top of the README, docs/pictures/moving.svg
.PHONY: picture
picture: $(BUILT)
	$(BIN)/python tools/moving_picture.py

## errors: deliberate errors, one at a time; each must be caught by the tests. ONLY="name name" makes some of them
ONLY ?=
errors: $(BUILT)
	$(BIN)/python tools/deliberate_errors.py $(ONLY)

## package-errors: those of the package alone, with the native module that is installed; minutes, nothing is built
.PHONY: package-errors
package-errors: $(BUILT)
	$(BIN)/python tools/deliberate_errors.py --package $(ONLY)

## install-check: wheel, source archive and folder, each installed into an empty environment and used there; minutes
install-check: $(PACKING)
	$(BIN)/python tools/install_check.py

## peers: other programs for `make bench`, each in an environment of its own in out/peers
.PHONY: peers
peers:
	for peer in casadi exudyn mujoco pinocchio drake sundae; do \
	  $(PYTHON) -m venv out/peers/$$peer && \
	  out/peers/$$peer/bin/python -m pip install --quiet --only-binary=:all: --requirement benches/peers/$$peer.txt || exit 1; \
	done

## beside: the reference problems of docs/others.md by other programs, those that `make peers` installed
.PHONY: beside
beside: $(BUILT)
	@for peer in mujoco exudyn pinocchio drake; do \
	  if [ -x out/peers/$$peer/bin/python ]; then \
	    echo "== $$peer" && PYTHONPATH=python out/peers/$$peer/bin/python tools/beside_$$peer.py || exit 1; \
	  else echo "== $$peer is not installed: make peers"; fi; \
	done

## sheet: figures of twelve mechanisms on one sheet, to be looked at, in out/contact-sheet.png (WORD=overview, reactions, ...)
WORD ?= overview
.PHONY: sheet
sheet: $(BUILT)
	$(BIN)/python tools/contact_sheet.py $(WORD)

# What wheels are made with. On Linux they are linked for an older system than this one, by zig.
$(PACKING): $(TOOLS) constraints-wheels.txt
	$(BIN)/python -m pip install --quiet --no-compile --only-binary=:all: --requirement constraints-wheels.txt
	@touch $@

## wheels: the wheel of this machine in dist/: its contents and size looked at, then installed and used in an empty environment of every Python that is here
.PHONY: wheels
wheels: $(PACKING)
	$(BIN)/python tools/wheels.py $(if $(filter Linux,$(shell uname -s)),--zig)
	$(BIN)/python tools/install_check.py dist

# torch with all it asks for, beside what is there already.
TORCH := .venv/.torch
$(TORCH): $(TOOLS) constraints-torch.txt
	$(QUIETLY) "Installing torch" "minutes and gigabytes, by network" \
		$(BIN)/python -m pip install --no-compile --only-binary=:all: --requirement constraints-torch.txt
	@touch $@

## torch: torch, some gigabytes on Linux, then the tests of gradients in it
.PHONY: torch
torch: $(BUILT) $(TORCH)
	$(BIN)/python -m pytest -q tests/python/test_through.py

## bench: measured costs against their limits
bench: $(BUILT)
	$(BIN)/python benches/run.py

## speed: docs/speed.md and its figure, from the numbers of the last `make bench`
.PHONY: speed
speed: $(BUILT)
	$(BIN)/python benches/page.py out/bench.json docs

# The generator of the site, beside what is there already.
$(SITE): $(TOOLS) constraints-docs.txt
	$(BIN)/python -m pip install --quiet --no-compile --only-binary=:all: --requirement constraints-docs.txt
	@touch $@

## docs: the site, with the reference of both languages, in out/docs
docs: $(BUILT) $(SITE) $(WEB)
	RUSTDOCFLAGS="-D warnings -A rustdoc::private-intra-doc-links" cargo doc --workspace --no-deps --locked --document-private-items
	rm -rf out/docs
	mkdir -p out/docs
	$(BIN)/python tools/docs.py --render out/docs
	cp -r $(or $(CARGO_TARGET_DIR),target)/doc out/docs/rust
	$(BIN)/python tools/docs.py --links out/docs
	$(BIN)/python tools/docs.py --look out/docs

## compare-docs: run the comparisons on docs/compare.md anew and put their tables there
compare-docs: $(BUILT)
	$(BIN)/python tools/compare_page.py --write

## paper: the claims about the criterion, computed and drawn in out/paper
paper: $(BUILT)
	@for script in geometry_pendulum geometry_four_bar pendulum four_bar_turn drift orders determinant individual frozen \
		switching closing reactions; do \
		$(BIN)/python examples/paper/$$script.py || exit 1; done

## demo: a four-bar and a squeezer, simulated, checked and drawn in out/
demo: announced $(BUILT)
	@$(BIN)/python examples/demo.py

.PHONY: announced
announced:
	@echo "Sets Partita up in .venv where it is not yet, then simulates, checks and draws two mechanisms in out/."

## clean: back to a fresh clone
clean:
	rm -rf .venv target out dist .pytest_cache .mypy_cache .ruff_cache
	find python tests -name '__pycache__' -type d -prune -exec rm -rf {} +
	rm -rf python/partita/_core*.so python/partita/_fmu python/partita/_web
