# The loop of this project: one rule a stage, with the artifact as target. `make help` says how to use it.
# Make only orders the stages. Whether anything is computed is decided by each command from content hashes (of its
# inputs, settings and stage version): where the artifact is fresh it says so and touches the file, so that make rests.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help iterate floor status check

R2S2R  ?= r2s2r
ITER   ?= 001
SOURCE ?=
PORT   ?=
CAMERA ?=
RUNS   ?= --random 15 --repeats 3
POLICIES ?=
EXECUTE_OPTIONS ?=

# ITER=2 and ITER=002 are the same iteration.
I := iterations/$(shell printf '%03d' "$$(expr '$(ITER)' + 0)" 2>/dev/null || printf '%s' '$(ITER)')

# The artifacts of one iteration, in order. A new stage is one name here and one rule below.
RECORD   := $(I)/10-record.h5
ESTIMATE := $(I)/20-estimate.h5
IDENTIFY := $(I)/30-identify.h5
PLAN     := $(I)/40-plan.h5
EXECUTE  := $(I)/50-execute.h5
EXECUTED := $(I)/51-estimate.h5
COMPARE  := $(I)/60-compare.h5

# The latest iteration before this one that has states: an iteration without runs of its own learns from those.
LAST := $(shell ls -d iterations/*/20-estimate.h5 iterations/*/51-estimate.h5 2>/dev/null \
          | sed 's,/[^/]*$$,,' | awk '$$0 < "$(I)"' | sort | tail -n 1)
FROM := $(ESTIMATE)
OWN  := $(RECORD) $(ESTIMATE)
ifeq ($(strip $(SOURCE))$(wildcard $(RECORD)),)
ifneq ($(LAST),)
FROM := $(wildcard $(LAST)/20-estimate.h5 $(LAST)/51-estimate.h5)
OWN  :=
endif
endif

# What earlier iterations know: `compare` sets their simulators beside the last one, and effects are kept from them.
EARLIER := $(shell ls iterations/*/30-identify.h5 2>/dev/null | awk '$$0 < "$(I)"')

# A plan is executed where there is a robot; runs that were executed are compared, else those of the iteration itself.
REAL := $(OWN)
ifneq ($(strip $(PORT))$(wildcard $(EXECUTE)),)
REAL := $(EXECUTE) $(EXECUTED)
endif
ARTIFACTS := $(OWN) $(IDENTIFY) $(PLAN) $(REAL) $(if $(REAL),$(COMPARE))

# What every stage depends on, besides its input. config.toml: settings of this iteration only, where there is one.
SETTINGS := project.toml robot.toml $(wildcard $(I)/config.toml)

# Raw runs cannot be made again: make must never delete them, whatever fails.
.PRECIOUS: $(RECORD) $(EXECUTE)

help:
	@echo 'make iterate ITER=001 SOURCE="a.csv b.csv"   bring the iteration up to date (SOURCE: logs to import, the first time)'
	@echo 'make iterate ITER=001 PORT=/dev/ttyUSB0 CAMERA=realsense   the same with the robot itself, which then executes the plan'
	@echo '                                             (RUNS: what is recorded, else 15 random targets, 3 times; POLICIES: of the plan)'
	@echo 'make iterate ITER=002 PORT=... CAMERA=...    the next: learns from the runs of the one before'
	@echo 'make floor                                  how far the robot repeats itself'
	@echo 'make status                                  what is fresh, what is stale and why'
	@echo 'make check                                   exit code 3 where something is stale or does not validate'

iterate: $(ARTIFACTS)

ifneq ($(strip $(SOURCE)),)
# With the sidecar of each log.
$(RECORD): $(SOURCE) $(wildcard $(addsuffix .toml,$(basename $(SOURCE)))) $(SETTINGS)
	"$(R2S2R)" import --iteration $(ITER) $(SOURCE)
else ifneq ($(strip $(PORT)),)
# Nothing stands behind the colon: a robot that has moved is not asked to do it again.
$(RECORD):
	"$(R2S2R)" record --iteration $(ITER) $(RUNS) --port "$(PORT)" $(if $(CAMERA),--camera "$(CAMERA)")
else
$(RECORD):
	@echo 'error: $@ is not there, and there is neither a log to import nor a robot to record' >&2
	@echo 'hint: make iterate ITER=$(ITER) SOURCE="a.csv b.csv"   # or PORT=/dev/ttyUSB0' >&2
	@exit 2
endif

$(ESTIMATE): $(RECORD) $(SETTINGS)
	"$(R2S2R)" estimate --iteration $(ITER)

$(IDENTIFY): $(FROM) $(EARLIER) $(SETTINGS)
	"$(R2S2R)" identify --iteration $(ITER)

$(PLAN): $(IDENTIFY) $(SETTINGS)
	"$(R2S2R)" plan --iteration $(ITER)

# Asks before the robot moves (EXECUTE_OPTIONS=--yes does not). Behind the bar: a plan that was made again moves no robot
# that has done its runs; where they are of an older plan, `status` says so.
$(EXECUTE): | $(PLAN)
	"$(R2S2R)" execute --iteration $(ITER) $(POLICIES) --port "$(PORT)" $(if $(CAMERA),--camera "$(CAMERA)") $(EXECUTE_OPTIONS)

$(EXECUTED): $(EXECUTE) $(SETTINGS)
	"$(R2S2R)" estimate --iteration $(ITER) --of execute

$(COMPARE): $(lastword $(REAL)) $(IDENTIFY) $(EARLIER) $(wildcard floor.h5) $(SETTINGS)
	"$(R2S2R)" compare --iteration $(ITER)

floor:
	"$(R2S2R)" floor

status:
	@"$(R2S2R)" status

check:
	@"$(R2S2R)" status --check
	@"$(R2S2R)" validate
