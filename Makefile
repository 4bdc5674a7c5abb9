# Any Python 3 can set the rest up; see tools/environments.py.
PYTHON ?= python3
VENV := .venv/bin/python
HOSTS := bpy-4.2 bpy-4.5 bpy-5.0 bpy-5.2 blender-4.3 blender-5.2 blender-own \
	blender-4.3-window blender-5.2-window blender-5.2-vulkan blender-own-window

.DEFAULT_GOAL := help
.PHONY: help setup demo composite foam test test-fast fuzz bench bench-peers bench-pictures bench-clusters bench-viewport bench-export bench-gourmel bench-methods bench-mishima bench-mueller bench-van-kooten bench-light bench-scaling lint format extension lock clean $(HOSTS)

help: ## Show this list
	@grep -hE '^[$$a-zA-Z()-]+:.*## ' Makefile | sed -e 's/$$(HOSTS)/HOST/' -e 's/:.*## /\t/' | expand -t 16
	@echo "HOST is one of: $(HOSTS)"

setup: ## Make the development environment in .venv, or bring it up to date
	@$(PYTHON) tools/environments.py development
	@$(VENV) tools/native_wheels.py

demo: setup ## Bake a dam break, render frames of it headless, write EXR files and pictures to out/demo
	@$(VENV) -m meniscus.samples.demo

composite: setup ## Lay the dam break over a scene of Cycles in the compositor, write out/composite.png
	@$(VENV) -m meniscus.samples.composite

foam: setup ## Render the dam break with foam on its surface particles, write out/foam.png
	@$(VENV) -m meniscus.samples.foam

test: setup ## Run all tests, in every Blender there is (BLENDER=/path adds your own)
	@$(VENV) tools/run_tests.py

test-fast: setup ## Run the quick unit, render and native tests
	@$(VENV) tools/run_tests.py --fast

fuzz: setup ## Fuzz the native core, each target for SECONDS (60)
	@$(VENV) tools/native_tests.py --fuzz $(or $(SECONDS),60)
bench: setup ## Time Meniscus on named scenes (ARGS="--scenes random_1k --repeats 3"); the machine must be idle
	@PYTHONPATH=tests $(VENV) -m bench.run_bench $(ARGS)

bench-peers: setup ## Time what users have today beside Meniscus, and judge both by the oracle
	@PYTHONPATH=tests:tools $(VENV) -m bench.run_peers $(ARGS)

bench-pictures: setup ## Render the pictures of docs/kanamori_2008.md anew (ARGS="--only figure_1")
	@PYTHONPATH=tests $(VENV) -m bench.paper_pictures $(ARGS)

bench-clusters: setup ## Render the picture of docs/clusters.md anew (ARGS="--frame 30")
	@PYTHONPATH=tests $(VENV) -m bench.cluster_pictures $(ARGS)

bench-viewport: extension ## Time the viewport in real windows with 120,000 particles (ARGS="--windows blender-5.2-vulkan")
	@PYTHONPATH=tests:tools $(VENV) -m bench.viewport $(ARGS)

bench-scaling: setup ## Time each method against balls, resolution, density and kernel, and stages on the GPU (ARGS="--size 640x480")
	@PYTHONPATH=tests $(VENV) -m bench.scaling $(ARGS)

bench-light: setup ## Time primary rays, shadows, occlusion and reflections on the GPU (ARGS="--size 640x480 --scenes 'pool 10k'")
	@PYTHONPATH=tests $(VENV) -m bench.traced_light $(ARGS)

bench-gourmel: setup ## Time traced light on the scenes of docs/gourmel_2010.md (ARGS="--scenes pool --pictures")
	@PYTHONPATH=tests $(VENV) -m bench.gourmel_2010 $(ARGS)

bench-methods: setup ## Compare all methods on the scene of docs/methods.md (ARGS=--pictures renders its pictures)
	@PYTHONPATH=tests $(VENV) -m bench.methods $(ARGS)

bench-mishima: setup ## Time Equal Interval on the scenes of docs/mishima_2008.md (ARGS="--balls 4096 --pictures")
	@PYTHONPATH=tests $(VENV) -m bench.mishima_2008 $(ARGS)

bench-mueller: setup ## Time the methods and data sets of docs/mueller_2007.md (ARGS="--scenes ethane --pictures")
	@PYTHONPATH=tests $(VENV) -m bench.mueller_2007 $(ARGS)

bench-van-kooten: setup ## Repeat the experiments of docs/van_kooten_2007.md (ARGS=--pictures renders its pictures)
	@PYTHONPATH=tests $(VENV) -m bench.van_kooten_2007 $(ARGS)

bench-export: setup ## Time passes and files beside the surface, and watch the memory over 500 frames (ARGS="--frames 10")
	@PYTHONPATH=tests $(VENV) -m bench.export $(ARGS)

lint: setup ## Check style, format, types, import rules and shaders
	@$(VENV) tools/lint.py

format: setup ## Format the Python and Rust files
	@.venv/bin/ruff check --quiet --fix-only . && .venv/bin/ruff format .
	@$(VENV) tools/rust.py cargo fmt --all

extension: setup ## Build dist/meniscus-VERSION.zip with Blender's own tool
	@$(VENV) tools/build_extension.py

$(HOSTS): extension ## Run tests/blender or tests/gui in one Blender (ARGS="-k camera" goes to pytest)
	@$(VENV) tools/hosts.py $@ $(ARGS)

lock: setup ## Pin anew what requirements/*.in ask for, and the wheels in the manifest
	@$(VENV) tools/lock.py

clean: ## Delete what was built and rendered; the environments and downloads stay
	@rm -rf out dist wheels native/target native/fuzz/target .pytest_cache .ruff_cache .mypy_cache .hypothesis
