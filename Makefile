# The front door. Every target sets up what it needs first; nothing else need be typed.
.PHONY: help run test types fast-tests lint fuzz-quick fuzz soak bench nightly films possess-films scan-films session-films example-films setup setup-dev docs examples record-references clean test-slow test-long test-more test-matrix test-bare release test-arm test-devices panel audit test-web

help:            ## what can be made
	@grep -E '^[a-z-]+:.*##' Makefile | sed -E 's/:.*## /\t/' | expand -t 20

run: setup       ## watch a chair move with a recorded person (a window, or a film where there is no display)
	@.venv/bin/enliven run $(ARGS)

PYTEST = .venv/bin/python scripts/run_tests.py

test: setup-dev  ## linters, types, the fast tests, and one run of the main job
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@$(MAKE) -s -j2 types fast-tests

# The types are checked while the tests start.
types:
	@.venv/bin/pyrefly check --summary=none

fast-tests:
	@$(PYTEST) -m "not slow" $(ARGS)

test-slow: setup-dev ## all other tests: real recordings, real windows and whole programs (CI runs them after make test)
	@$(PYTEST) -m slow $(ARGS)

test-long: setup-dev ## the long forms of tests: 50 windows killed, 500 random strokes and actions, 10,000 visitors, a sitting (25 minutes)
	@ENLIVEN_KILLS=50 ENLIVEN_STROKES=500 .venv/bin/python -m pytest -n 0 -q tests/viewer/studio/test_studio_strokes.py \
		tests/viewer/studio/test_studio_files.py -k "strokes or real_windows" $(ARGS)
	@ENLIVEN_SITTING=1 .venv/bin/python -m pytest -n 0 -q tests/viewer/studio/test_sitting_window.py $(ARGS)
	@ENLIVEN_ACTIONS=500 ENLIVEN_MADE_AGAIN=270 .venv/bin/python -m pytest -n 0 -q tests/edge/test_shipped_recording.py \
		tests/viewer/studio/test_studio_actions.py -k "random or again" $(ARGS)
	@ENLIVEN_VISITORS=10000 .venv/bin/python -m pytest -n 0 -q tests/system/test_hostile_visitors.py -k departed $(ARGS)

test-more: setup-dev ## search at random for what breaks a law: make test-more MINUTES=10 ARGS=tests/edge
	@.venv/bin/python scripts/test_more.py --minutes $(or $(MINUTES),10) $(ARGS)

test-matrix: setup-dev ## the tests as on other processors and in other orders: make test-matrix ONLY="haswell load"
	@.venv/bin/python scripts/test_matrix.py $(if $(ONLY),--only $(ONLY)) -- $(ARGS)

test-bare:       ## both commands in bare Debians 12 and 13 and Ubuntu 24.04 (as root): make test-bare ONLY=noble
	@sh scripts/test_bare.sh $(ONLY)

test-arm: setup-dev ## the numeric core's tests on an emulated aarch64, or with ONLY=release the edge of make release (as root; slow)
	@sh scripts/test_arm.sh $(ONLY)

test-web: setup-dev ## exported files, and the web page, in Chromium (npm and chromium; pictures in out/web/pictures)
	@npm install --silent --no-save --prefix out/web three@0.187.0 gltfpack@1.3.0 gltf-validator@2.0.0-dev.3.10
	@npm ci --silent --prefix integrations/web
	@.venv/bin/python -m pytest -n 0 tests/viewer/render/test_other_viewer.py \
		tests/real/test_other_viewer_real.py tests/real/test_validators_real.py tests/shared/formats/test_meshopt.py \
		tests/system/test_web_page.py tests/shared/wire/test_typescript_reader.py $(ARGS)

test-devices:    ## the panel's firmware, all of the camera drivers' contract, then devices in a guest (as root): ONLY=guest
	@sh scripts/setup.sh devices
	@[ -n "$(filter-out panel,$(ONLY))" ] || .venv/bin/python -m pytest tests/devices $(ARGS)
	@[ -n "$(filter-out contract,$(ONLY))" ] || ENLIVEN_CONTRACT=full .venv/bin/python -m pytest tests/edge/sensors/test_contract.py $(ARGS)
	@[ -n "$(filter-out guest,$(ONLY))" ] || sh scripts/test_guest.sh $(if $(filter guest,$(ONLY)),$(ARGS))

test-kiosk:      ## a kiosk in a container with systemd: each program killed, the power cut KILLS=20 times (as root; out/kiosk)
	@sh scripts/setup.sh dev
	@sh scripts/test_kiosk.sh $(ARGS)

panel:           ## build the firmware of the button panel, and write it to a board: make panel PORT=/dev/ttyUSB0
	@$(MAKE) -s -C firmware_configs/panel $(if $(PORT),flash)

release: setup-dev ## build sdists and wheels, check them, and work with them in empty environments: docs/releasing.md
	@.venv/bin/python -m pip install -q -c constraints.txt -r scripts/release-requirements.txt
	@.venv/bin/python scripts/release.py $(ARGS)

audit: setup-dev ## vulnerabilities, licences and telemetry of all packages; without a network: make audit ARGS=--offline
	@.venv/bin/python scripts/audit.py $(ARGS)

lint: setup-dev  ## linters and types only
	@.venv/bin/ruff check . && .venv/bin/ruff format --check . && .venv/bin/pyrefly check

fuzz-quick: setup-dev ## 10,000 mutated files and messages to every reader, the same every time (part of make test)
	@.venv/bin/python -m pytest tests/fuzz $(ARGS)

fuzz: setup-dev  ## search for inputs that break a reader: make fuzz SECONDS=600 SEED=7 ONLY=gltf, or REPEAT=out/fuzz/FILE
	@.venv/bin/python -m pip install -q -c constraints.txt --only-binary :all: -r tests/fuzz/requirements.txt || \
		echo "atheris cannot be installed here, so the search is not guided by coverage"
	@.venv/bin/python tests/fuzz/run.py $(if $(SECONDS),--seconds $(SECONDS)) $(if $(SEED),--seed $(SEED)) \
		$(if $(ONLY),--only "$(ONLY)") $(if $(REPEAT),--repeat "$(REPEAT)")

soak: setup-dev  ## a day of an exhibition with faults and kills, in 50 minutes: make soak MINUTES=5 SEED=1
	@.venv/bin/python tests/soak/soak.py $(if $(MINUTES),--minutes $(MINUTES)) $(if $(SEED),--seed $(SEED))

bench: setup-dev ## measure: make bench, or make bench ONLY=road
	@.venv/bin/python -m pip install -q -c constraints.txt -r tests/benchmarks/requirements.txt
	@.venv/bin/python tests/benchmarks/run.py $(ONLY)

nightly: setup-dev ## test-long, fuzzing for 600 s, and headline benchmarks that must not get worse: ARGS=--update
	@.venv/bin/python -m pip install -q -c constraints.txt -r tests/benchmarks/requirements.txt
	@.venv/bin/python tests/benchmarks/nightly.py $(ARGS)

docs: setup-dev  ## the documentation as a site with search and the library's API, into out/site
	@.venv/bin/python -m pip install -q -c constraints.txt -r docs/requirements.txt
	@.venv/bin/python -m mkdocs build -q && echo "out/site is built; to read it with its search: .venv/bin/python -m http.server -d out/site"

films: setup-dev ## film what the tracker makes of the real recordings, into out/tracking: make films ONLY="uva four"
	@.venv/bin/python tests/benchmarks/tracking/tracking_films.py $(ONLY)

possess-films: setup-dev ## film what real people possess, into out/possess: make possess-films ONLY="chair horse"
	@.venv/bin/python tests/benchmarks/possession/possess_films.py $(ONLY)

scan-films: setup-dev ## film scans that are cut out and act, into out/scanning: make scan-films ONLY="chair"
	@.venv/bin/python tests/benchmarks/scanning/scan_films.py $(ONLY)

session-films: setup-dev ## film the paper's sessions in the studio, into out/sessions: make session-films ONLY="squid"
	@.venv/bin/python tests/benchmarks/examples/session_films.py $(ONLY)

example-films: setup-dev ## film meshes that act by a few example poses, into out/examples: make example-films ONLY="cactus"
	@.venv/bin/python tests/benchmarks/examples/example_films.py $(ONLY)

examples: setup-dev ## run the scripts of examples/ that need no files of yours, into out/scripts
	@mkdir -p out/scripts && cd out/scripts && for script in $(or $(ONLY),possess_chair legs_only made_mesh scan_and_possess \
		canon cut_and_merge cut_leg undo_edits key_poses star two_performers knock_over track_people \
		rigged_dog walking_dog sample_mesh carried_camera); do \
		echo "$$script" && ../../.venv/bin/python ../../examples/$$script.py || exit 1; done

record-references: setup-dev ## record the stored poses and picture of tests/system again, on purpose
	@.venv/bin/python -m pytest tests/system --record-references

setup:
	@sh scripts/setup.sh run

setup-dev:
	@sh scripts/setup.sh dev

clean:           ## remove what was made here
	rm -rf .venv out build dist .pytest_cache .ruff_cache
