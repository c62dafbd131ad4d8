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
RUNS   ?= --random 15 --repeats 3

# ITER=2 and ITER=002 are the same iteration.
I := iterations/$(shell printf '%03d' "$$(expr '$(ITER)' + 0)" 2>/dev/null || printf '%s' '$(ITER)')

# The artifacts of one iteration, in order. A new stage is one name here and one rule below.
RECORD   := $(I)/10-record.h5
ESTIMATE := $(I)/20-estimate.h5
IDENTIFY := $(I)/30-identify.h5
ARTIFACTS := $(RECORD) $(ESTIMATE) $(IDENTIFY)

# The iteration before: one without runs of its own learns from those.
LAST := iterations/$(shell printf '%03d' "$$(expr '$(ITER)' - 1)" 2>/dev/null || printf 'none')
FROM := $(ESTIMATE)
ifeq ($(strip $(SOURCE))$(wildcard $(RECORD)),)
ifneq ($(wildcard $(LAST)/20-estimate.h5 $(LAST)/51-estimate.h5),)
FROM := $(wildcard $(LAST)/20-estimate.h5 $(LAST)/51-estimate.h5)
ARTIFACTS := $(IDENTIFY)
endif
endif

# What every stage depends on, besides its input. config.toml: settings of this iteration only, where there is one.
SETTINGS := project.toml robot.toml $(wildcard $(I)/config.toml)

# Raw runs cannot be made again: make must never delete them, whatever fails.
.PRECIOUS: $(RECORD)

help:
	@echo 'make iterate ITER=001 SOURCE="a.csv b.csv"   bring the iteration up to date (SOURCE: logs to import, the first time)'
	@echo 'make iterate ITER=001 PORT=/dev/ttyUSB0     the same with runs of the robot itself (RUNS: which, else 15 random targets, 3 times)'
	@echo 'make floor                                  how far the robot repeats itself'
	@echo 'make status                                  what is fresh, what is stale and why'
	@echo 'make check                                   exit code 3 where something is stale or does not validate'

iterate: $(ARTIFACTS)

ifneq ($(strip $(SOURCE)),)
$(RECORD): $(SOURCE) $(SETTINGS)
	"$(R2S2R)" import --iteration $(ITER) $(SOURCE)
else ifneq ($(strip $(PORT)),)
# Nothing stands behind the colon: a robot that has moved is not asked to do it again.
$(RECORD):
	"$(R2S2R)" record --iteration $(ITER) $(RUNS) --port "$(PORT)"
else
$(RECORD):
	@echo 'error: $@ is not there, and there is neither a log to import nor a robot to record' >&2
	@echo 'hint: make iterate ITER=$(ITER) SOURCE="a.csv b.csv"   # or PORT=/dev/ttyUSB0' >&2
	@exit 2
endif

$(ESTIMATE): $(RECORD) $(SETTINGS)
	"$(R2S2R)" estimate --iteration $(ITER)

$(IDENTIFY): $(FROM) $(SETTINGS)
	"$(R2S2R)" identify --iteration $(ITER)

floor:
	"$(R2S2R)" floor

status:
	@"$(R2S2R)" status

check:
	@"$(R2S2R)" status --check
	@"$(R2S2R)" validate
