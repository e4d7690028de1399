# Each target sets up what it needs (scripts/setup.sh). `make` alone lists the targets.
BIN := .venv/bin

.PHONY: help setup demo test lint gallery bench clean

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 18

setup: ## system packages (only as root or by sudo -n; never with NO_APT=1), .venv and Python packages
	@sh scripts/setup.sh

demo: setup ## render the scenes of examples/ into out/demo/
	$(call render_examples,out/demo)

test: lint ## check style and types, then run the tests
	$(BIN)/pytest

lint: setup ## check style and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

gallery: setup ## render the scenes, views and figures of examples/ into docs/gallery/
	$(call render_examples,docs/gallery)
	$(BIN)/python examples/gallery/views.py -o docs/gallery
	$(BIN)/python examples/paper/figures.py -o docs/gallery/paper --size 320x360

bench: setup ## measure time and error on this machine; options in ARGS
	$(BIN)/skincli bench $(ARGS)

clean: ## remove everything these targets made, .venv too
	rm -rf .venv out build dist .pytest_cache .ruff_cache .mypy_cache

define render_examples
@mkdir -p $(1); \
for scene in examples/[0-9]*.yaml; do \
    test -e "$$scene" || { echo "there is no scene in examples/" >&2; exit 1; }; \
    name=$$(basename "$$scene" .yaml); \
    picture=$(1)/$${name#*_}.png; \
    echo "$$scene -> $$picture"; \
    $(BIN)/skincli render "$$scene" -o "$$picture" || exit; \
done; \
echo "The pictures are in $(1)/."
endef
