# Any Python 3 can set the rest up; see tools/environments.py.
PYTHON ?= python3
VENV := .venv/bin/python
HOSTS := bpy-4.2 bpy-4.5 bpy-5.0 bpy-5.2 blender-4.3 blender-5.2 blender-own

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-fast lint format extension lock clean $(HOSTS)

help: ## Show this list
	@grep -hE '^[$$a-zA-Z()-]+:.*## ' Makefile | sed -e 's/$$(HOSTS)/HOST/' -e 's/:.*## /\t/' | expand -t 14
	@echo "HOST is one of: $(HOSTS)"

setup: ## Make the development environment in .venv, or bring it up to date
	@$(PYTHON) tools/environments.py development

demo: setup ## Bake a dam break, render frames of it headless, write EXR files and pictures to out/demo
	@$(VENV) -m meniscus.samples.demo

test: setup ## Run all tests, in every Blender there is (BLENDER=/path adds your own)
	@$(VENV) tools/run_tests.py

test-fast: setup ## Run the unit tests and the quick render tests
	@$(VENV) tools/run_tests.py --fast

lint: setup ## Check style, format, types and the import rules
	@$(VENV) tools/lint.py

format: setup ## Format the Python files
	@.venv/bin/ruff check --quiet --fix-only . && .venv/bin/ruff format .

extension: setup ## Build dist/meniscus-VERSION.zip with Blender's own tool
	@$(VENV) tools/build_extension.py

$(HOSTS): extension ## Run tests/blender in one Blender (ARGS="-k camera" goes to pytest)
	@$(VENV) tools/hosts.py $@ $(ARGS)

lock: setup ## Pin anew what requirements/*.in ask for, and the wheels in the manifest
	@$(VENV) tools/lock.py

clean: ## Delete what was built and rendered; the environments and downloads stay
	@rm -rf out dist wheels .pytest_cache .ruff_cache .mypy_cache
