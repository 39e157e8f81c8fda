# Two commands: `make bench` for a first ranked table, `make test` for lint, types and tests.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := samplers renderer metrics experiments
RENDERERS := .venv-renderers

.PHONY: bench test lint types docs site results published published-renderers advice robustness fuzz renderers lock clean

bench: $(VENV)/.installed
	$(BIN)/envlight run table1 --scale quick --scenes vase --executor processes

# The published tables and picture: those of the quick run.
results: bench
	rm -rf results/table1-quick
	$(BIN)/envlight publish runs/table1-quick results/table1-quick --montage vase_gothic-church_lights=16 --compare $(FIVE)
	$(BIN)/envlight results-page results

# All other published runs, on Poly Haven's maps where ENVLIGHT_MAPS or `envlight fetch
# poly-haven-32` has put them, and on those of HOLDOUT, a folder of other maps, and EVERY, one with
# both, where they are set (`envlight fetch` takes the names of maps in a published run's rows):
# many hours on two cores, the timed ones for a quiet machine. A run that is stopped goes on where
# it was; `make published DRY=--dry-run` says what is left, and of grids how long that takes. A grid
# of many hours can be measured in parts, by `--maps` say, for `envlight join`. Of two runs that
# time the same methods, that one is published which keeps its budgets more often, or has fewer
# noisy rows: both are told in the report.
ON_MAPS := --environments poly-haven-32 --scenes rubiks-cube,vase,teapot,birdcage
LARGE := --scale standard --environments poly-haven-32 --executor processes --threads 1
LARGE_ON_EVERY := --scale standard --environments '$(EVERY)' --executor processes --threads 1 --no-images
SEVEN := mis,fhis,median-cut,variance-minimization,tmms,ours-no-upsampling,ours
# One embedded map of every kind, and five of them.
KINDS := noon-desert,overcast-moor,sunset-mountains,moonlit-hills,gallery-skylight,warehouse-tubes,studio-two-softboxes,forest-sun-flecks,constant
FIVE := noon-desert,overcast-moor,gallery-skylight,moonlit-hills,studio-two-softboxes
SIX := fireplace,kiara_1_dawn,brown_photostudio_01,dikhololo_night,noon_grass,snowy_field
# Every second map, by name.
HALF := aircraft_workshop_01,autoshop_01,chinese_garden,circus_arena,crystal_falls,dikhololo_night,entrance_hall,industrial_pipe_and_valve_02,kloppenheim_05,neuer_zollhof,pedestrian_overpass,potsdamer_platz,royal_esplanade,spree_bank,st_fagans_interior,venice_sunset
# Every eighth map of EVERY, by name.
EIGHT := aircraft_workshop_01,chinese_garden,dresden_square,hilly_terrain_01,moonless_golf,piazza_bologni,sepulchral_chapel_rotunda,studio_small_08
# No choice of a sampler was made by these: the first nineteen, by name, of those left.
UNSEEN := artist_workshop,blocky_photo_studio,brown_photostudio_06,cave_wall,dry_hay_field,empty_warehouse_01,forest_slope,future_parking,hamburg_hbf,immenstadter_horn,leadenhall_market,lebombo,modern_buildings_2,mud_road_puresky,paul_lobe_haus,peppermint_powerplant,pillars,provence_studio,quarry_02
STUDIES := light-distribution \
	kd-tree-throughput kd-tree-fits kd-tree-quality skipping discrepancy static-sampling \
	dynamic-sequence area-lights stability renderer-tables
PUBLISHED := table1-seconds table1-standard table1-standard-lights table1-standard-counts \
	table1-paper-time table1-paper-size table1-paper-size-4s table1-paper-size-scenes \
	table1-paper-size-scenes-4s table1-as-published table1-as-published-standard table1-ris \
	mis-numbers ranking table2 renderers renderers-seconds which-sampler-standard \
	glossy light-generation-time illumination-cut equal-time convergence \
	$(STUDIES)
# A run that ends with status 1 has kept all rows but those that failed: readings of the kd-tree's law
# do, whose densities are not those of its samples, and the report names them.
SOME_FAIL := || test $$? -eq 1
ON_EVERY := which-sampler-photographed-standard readings readings-standard readings-unseen

published: $(VENV)/.installed
	$(BIN)/envlight run $(DRY) table1 --environments poly-haven-32 --scenes rubiks-cube,vase --samplers $(SEVEN) --budget seconds=0.02 --no-images --output runs/table1-seconds
	$(BIN)/envlight run $(DRY) table1 --scale standard --environments poly-haven-32 --maps kiara_1_dawn --scenes vase --budget lights=16 --output runs/table1-standard-lights
	$(BIN)/envlight run $(DRY) table1 $(LARGE) --scenes vase,rubiks-cube,teapot,birdcage --budget lights=16 --no-images --output runs/table1-standard-lights
	$(BIN)/envlight run $(DRY) table1 $(LARGE) --scenes vase --budget lights=8,lights=32,lights=64 --no-images --output runs/table1-standard-counts
	$(BIN)/envlight run $(DRY) table1 --scale standard --environments poly-haven-32 --maps '$(HALF)' --scenes vase --samplers $(SEVEN) --budget seconds=0.15 --no-images --output runs/table1-standard
	$(BIN)/envlight run $(DRY) table1 --scale standard --environments poly-haven-32 --maps '$(HALF)' --scenes vase --samplers $(SEVEN) --budget seconds=0.64 --no-images --output runs/table1-paper-time
	$(BIN)/envlight run $(DRY) table1 --scale paper --environments poly-haven-32 --scenes vase --budget seconds=0.9 --no-images --output runs/table1-paper-size
	$(BIN)/envlight run $(DRY) table1 --scale paper --environments poly-haven-32 --scenes rubiks-cube,teapot,birdcage --budget seconds=0.9 --no-images --output runs/table1-paper-size-scenes
	$(BIN)/envlight run $(DRY) table1 --scale paper --environments poly-haven-32 --scenes vase --samplers $(SEVEN),mis-compensated,lightgen,kollig-keller,q2-tree,ris --budget seconds=4 --no-images --output runs/table1-paper-size-4s
	$(BIN)/envlight run $(DRY) table1 --scale paper --environments poly-haven-32 --scenes rubiks-cube,teapot,birdcage --samplers $(SEVEN),mis-compensated,lightgen,kollig-keller,q2-tree,ris --budget seconds=4 --no-images --output runs/table1-paper-size-scenes-4s
	$(BIN)/envlight run $(DRY) table1-as-published $(LARGE) --maps '$(HALF)' --scenes vase,rubiks-cube --no-images --output runs/table1-as-published-standard
	$(BIN)/envlight run $(DRY) table1-as-published --scale paper $(ON_MAPS) --executor processes --threads 1 --no-images --output runs/table1-as-published
	$(BIN)/envlight run $(DRY) table1 $(ON_MAPS) --samplers 'mis,mis[numbers=independent],median-cut,ours' --budget lights=4,rays=4 --no-images --output runs/mis-numbers
	$(BIN)/envlight run $(DRY) ranking $(LARGE) --scenes vase --budget rays=4 --no-images --output runs/ranking
	$(BIN)/envlight run $(DRY) table1 --scenes glossy,vase,teapot --samplers mis,mis-compensated,ris --budget rays=4,rays=8,rays=16 --maps $(KINDS) --no-images --output runs/table1-ris
	$(BIN)/envlight run $(DRY) table2 $(LARGE) --budget lights=16 --no-images --output runs/table2
	$(BIN)/envlight run $(DRY) renderers $(LARGE) --scenes rubiks-cube,vase --budget lights=8,lights=32,rays=16 --seeds 1 --no-images --output runs/renderers
	$(BIN)/envlight run $(DRY) glossy --scale standard --maps $(KINDS),room-one-window,fireplace-cabin --output runs/glossy
	$(BIN)/envlight run $(DRY) renderers --scenes vase --maps $(FIVE) --budget seconds=0.02 --reference-noise 0.006 --no-images --output runs/renderers-seconds
	$(BIN)/envlight run $(DRY) which-sampler --scale standard --scenes rubiks-cube,vase --budget lights=4,lights=8,lights=16,lights=32,lights=64 --executor processes --threads 1 --no-images --output runs/which-sampler-standard
	$(BIN)/envlight run $(DRY) equal-time --scale standard --environments poly-haven-32 --maps $(SIX) --scenes vase --output runs/equal-time
	$(BIN)/envlight run $(DRY) illumination-cut $(LARGE) --maps '$(HALF)' --scenes vase --output runs/illumination-cut
	$(BIN)/envlight run $(DRY) convergence --scale standard --environments poly-haven-32 --scenes rubiks-cube,vase --seeds 1 --no-images --output runs/convergence
	$(BIN)/envlight run $(DRY) light-generation-time --scale standard --output runs/light-generation-time
	for name in $(STUDIES); do $(BIN)/envlight run $(DRY) $$name --output runs/$$name || exit 1; done
	test -n '$(DRY)' || for name in $(PUBLISHED); do $(BIN)/envlight publish runs/$$name results/$$name || exit 1; done
	test -z '$(EVERY)' || $(BIN)/envlight run $(DRY) which-sampler $(LARGE_ON_EVERY) --scenes rubiks-cube,vase --budget lights=4,lights=8,lights=16,lights=32 --output runs/which-sampler-photographed-standard
	test -z '$(EVERY)' || $(BIN)/envlight run $(DRY) readings --scale medium --environments '$(EVERY)' --maps '$(EIGHT)' --executor processes --threads 1 --no-images --output runs/readings $(SOME_FAIL)
	test -z '$(EVERY)' || $(BIN)/envlight run $(DRY) readings $(LARGE_ON_EVERY) --maps '$(EIGHT)' --scenes rubiks-cube --budget lights=16 --output runs/readings-standard $(SOME_FAIL)
	test -z '$(EVERY)' || $(BIN)/envlight run $(DRY) readings $(LARGE_ON_EVERY) --maps '$(UNSEEN)' --scenes vase --budget lights=16 --output runs/readings-unseen $(SOME_FAIL)
	test -z '$(HOLDOUT)' || $(BIN)/envlight run $(DRY) table1 --scale standard --environments '$(HOLDOUT)' --scenes vase --budget lights=16 --executor processes --threads 1 --no-images --output runs/table1-holdout
	test -n '$(DRY)' || for name in $(if $(EVERY),$(ON_EVERY)) $(if $(HOLDOUT),table1-holdout); do $(BIN)/envlight publish runs/$$name results/$$name || exit 1; done
	test -n '$(DRY)' || $(BIN)/envlight results-page results

# Mitsuba 3, Cycles and LuxCore on eight of these maps, one of every kind: for a quiet machine, half an
# hour on two cores. Mitsuba is at its best with an LLVM library of the system.
published-renderers: $(VENV)/.installed renderers
	$(BIN)/envlight run production-renderers --environments poly-haven-32 --output runs/production-renderers
	$(BIN)/envlight publish runs/production-renderers results/production-renderers
	$(BIN)/envlight results-page results

# Static pages of everything in results/: open site/index.html. Runs whose images are in runs/ get pages
# that compare them.
site: $(VENV)/.installed
	$(BIN)/envlight site results site --runs runs

# The table that `envlight advise` reads, from published rows.
advice: $(VENV)/.installed
	$(BIN)/envlight advice-table results/which-sampler-standard results/which-sampler-photographed-standard --output experiments/questions/advice/measured.json

# Campaigns that try to break it, about half an hour; `--publish` puts their figures into results/performance.
robustness: $(VENV)/.installed fuzz
	$(BIN)/python -m tests.robustness kills

fuzz: $(VENV)/.installed
	$(BIN)/python -m tests.robustness files
	$(BIN)/python -m tests.robustness maps

test: $(VENV)/.installed-test lint types
	$(BIN)/python -m pytest -n 2 --dist worksteal

lint: $(VENV)/.installed-test
	$(BIN)/ruff check $(SOURCES) tests examples
	$(BIN)/ruff format --check $(SOURCES) tests examples
	PYTHONPATH=. $(BIN)/lint-imports

types: $(VENV)/.installed-test
	$(BIN)/mypy

# Mitsuba 3, Blender and LuxCore for `envlight run production-renderers`: 1.6 GB, in an environment of
# their own. Blender's package is made for Python 3.11 alone.
RENDERERS_PYTHON ?= python3.11

renderers: $(RENDERERS)/.installed

$(RENDERERS)/.installed: pyproject.toml
	test -x $(RENDERERS)/bin/python || $(RENDERERS_PYTHON) -m venv $(RENDERERS)
	$(RENDERERS_PYTHON) -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["renderers"], sep="\n")' > $(RENDERERS)/requirements.txt
	$(RENDERERS)/bin/python -m pip install --quiet --disable-pip-version-check -r $(RENDERERS)/requirements.txt
	@touch $@

# Pages about every public name, from the docstrings: open api/index.html.
docs: $(VENV)/.installed-docs
	$(BIN)/python -m experiments.cli.api_pages api

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed; set PYTHON=python3.x")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

$(VENV)/.installed-test: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,peer,cluster,usd,docs]'
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-docs: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	@touch $@ $(VENV)/.installed

# Renew the constraints from the ranges of pyproject.toml, in an environment of its own.
lock:
	$(PYTHON) -m venv $(VENV)-lock
	$(VENV)-lock/bin/python -m pip install --quiet --disable-pip-version-check -e '.[test,peer,cluster,usd,docs]'
	$(VENV)-lock/bin/python -m pip freeze --exclude-editable --exclude envlight > constraints.txt
	rm -rf $(VENV)-lock

clean:
	rm -rf $(VENV) $(RENDERERS) runs site *.egg-info .pytest_cache .mypy_cache .ruff_cache
