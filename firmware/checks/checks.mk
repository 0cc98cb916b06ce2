# Checks of the core: fuzzing, branch coverage, static analysis.

PYTHON ?= python3
RUNS ?= 10000000
FUZZER = clang
FUZZ = $(filter-out core/can_layout.c,$(CORE)) boards/script/bench.c checks/fuzz.c # a checksum of constants takes most of the time
FUZZ_LIMITS = -DVL_LARGEST_BLOCK=100 -DVL_MOST_BLOCKS=8 -DVL_LONGEST_PERIOD=64
SEED ?= 0
FUZZ_FLAGS = -max_len=256 -print_final_stats=1 -seed=$(SEED)

.PHONY: fuzz fuzz-serial fuzz-can fuzz-can-fd
fuzz: fuzz-serial fuzz-can fuzz-can-fd ## RUNS=n inputs by libFuzzer under sanitizers, in all (ten million)
fuzz-serial: $(BUILD)/fuzz-serial ## of these, two fifths over a serial line
fuzz-can: $(BUILD)/fuzz-can ## one fifth over classical CAN
fuzz-can-fd: $(BUILD)/fuzz-can-fd ## two fifths over CAN FD
fuzz-serial fuzz-can-fd: FIFTHS = 2
fuzz-can: FIFTHS = 1

$(BUILD)/fuzz-serial: WIRE = 0
$(BUILD)/fuzz-can: WIRE = 1
$(BUILD)/fuzz-can-fd: WIRE = 2
$(BUILD)/fuzz-serial $(BUILD)/fuzz-can $(BUILD)/fuzz-can-fd: $(FUZZ) $(HEADERS) | $(BUILD)
	$(FUZZER) $(WARNINGS) -O2 -g -fsanitize=fuzzer,address,undefined -fno-sanitize-coverage=trace-cmp \
	    -fno-sanitize-recover=all -DFUZZ_WIRE=$(WIRE) \
	    $(FUZZ_LIMITS) -Icore $(FUZZ) -o $@

fuzz-serial fuzz-can fuzz-can-fd:
	mkdir -p $(BUILD)/corpus/$@
	$(BUILD)/$@ $(FUZZ_FLAGS) -runs=$$(($(RUNS) * $(FIFTHS) / 5)) -artifact_prefix=$(BUILD)/ $(BUILD)/corpus/$@

# The same with the loop linked in: TICK=DIR, which is a folder that `rig firmware tick --target host` has filled.
.PHONY: fuzz-loop fuzz-loop-serial fuzz-loop-can-fd
fuzz-loop: fuzz-loop-serial fuzz-loop-can-fd ## TICK=DIR RUNS=n: half of the inputs over a serial line, half over CAN FD, with the loop on the device
$(BUILD)/fuzz-loop-serial: WIRE = 0
$(BUILD)/fuzz-loop-can-fd: WIRE = 2
LOOP_FUZZ_LIMITS = -DVL_HAS_TICK -DVL_TICK_BYTES=65536 -isystem $(TICK) -I$(BUILD)
$(BUILD)/records.h: checks/tick/records.py checks/tick/captures.py | $(BUILD)
	$(PYTHON) $< > $@
$(BUILD)/fuzz-loop-serial $(BUILD)/fuzz-loop-can-fd: $(FUZZ) $(HEADERS) checks/fuzz_loop.h $(BUILD)/records.h $(LOOP_FILES) | $(BUILD)
	$(FUZZER) $(WARNINGS) -O2 -g -fsanitize=fuzzer,address,undefined -fno-sanitize-coverage=trace-cmp \
	    -fno-sanitize-recover=all -DFUZZ_WIRE=$(WIRE) \
	    $(FUZZ_LIMITS) $(LOOP_FUZZ_LIMITS) -Icore $(FUZZ) $(LOOP_OBJECTS) -o $@
fuzz-loop-serial fuzz-loop-can-fd: fuzz-loop-%: $(BUILD)/fuzz-loop-%
	mkdir -p $(BUILD)/corpus/$@
	$(BUILD)/$@ $(FUZZ_FLAGS) -runs=$$(($(RUNS) / 2)) -artifact_prefix=$(BUILD)/ $(BUILD)/corpus/$@

# Branch coverage of the core by random scripts (tests/firmware/differential.py) and by what the fuzzer has found.
REQUESTS ?= 20000
LEAST ?= 95
COVERAGE = $(BUILD)/coverage
GCOV = gcc -std=c11 -O0 -g --coverage -fprofile-abs-path -Icore

.PHONY: coverage
coverage: $(COVERAGE)/script $(COVERAGE)/replay-0 $(COVERAGE)/replay-1 $(COVERAGE)/replay-2 ## branches of the core that scripts and the fuzzer's inputs reach
	find $(COVERAGE) -name '*.gcda' -delete
	cd .. && $(PYTHON) -m tests.firmware.differential $(abspath $(COVERAGE)/script) --requests $(REQUESTS)
	for wire in 0:serial 1:can 2:can-fd; do find $(BUILD)/corpus/fuzz-$${wire#*:} -type f 2>/dev/null \
	    | xargs -r $(COVERAGE)/replay-$${wire%:*} || exit 1; done
	gcovr --root . --filter core/ --object-directory $(COVERAGE) --branches --fail-under-branch $(LEAST) \
	    --txt $(COVERAGE)/report.txt --print-summary $(COVERAGE)
	cat $(COVERAGE)/report.txt

$(COVERAGE)/script: $(SCRIPT) $(HEADERS)
	mkdir -p $(COVERAGE)
	$(GCOV) $(SCRIPT) -o $@
$(COVERAGE)/replay-%: $(FUZZ) checks/replay.c $(HEADERS)
	mkdir -p $(COVERAGE)
	$(GCOV) -DFUZZ_WIRE=$* $(FUZZ_LIMITS) $(FUZZ) checks/replay.c -o $@

# Those of the core with the loop, by what the fuzzer has found with it; apart, for a header has two forms.
LEAST_LOOP ?= 85
OF_LOOP = $(BUILD)/coverage-loop
.PHONY: coverage-loop
coverage-loop: $(OF_LOOP)/replay-0 $(OF_LOOP)/replay-2 ## TICK=DIR: branches of the loop's part of the core that the inputs of fuzz-loop reach
	find $(OF_LOOP) -name '*.gcda' -delete
	for wire in 0:serial 2:can-fd; do find $(BUILD)/corpus/fuzz-loop-$${wire#*:} -type f 2>/dev/null \
	    | xargs -r $(OF_LOOP)/replay-$${wire%:*} || exit 1; done
	gcovr --root . --filter core/tick --filter core/can_loop --filter core/rows --object-directory $(OF_LOOP) --branches \
	    --fail-under-branch $(LEAST_LOOP) --txt $(OF_LOOP)/report.txt --print-summary $(OF_LOOP)
	cat $(OF_LOOP)/report.txt
$(OF_LOOP)/replay-%: $(FUZZ) checks/replay.c $(HEADERS) checks/fuzz_loop.h $(BUILD)/records.h $(LOOP_FILES)
	mkdir -p $(OF_LOOP)
	$(GCOV) -DFUZZ_WIRE=$* $(FUZZ_LIMITS) $(LOOP_FUZZ_LIMITS) $(FUZZ) checks/replay.c $(LOOP_OBJECTS) -o $@

# With TICK=DIR, which is a folder that `rig firmware tick --target host` has filled, the core with the loop. Without, some conditions
# are always true.
CPPCHECK = cppcheck --error-exitcode=1 --std=c11 --quiet --force -Icore -Iboards/plant $(if $(TICK),-DVL_HAS_TICK -I$(TICK),-UVL_HAS_TICK) \
    --suppress=knownConditionTrueFalse:core/device.c --suppress=knownConditionTrueFalse:core/sampling.c

.PHONY: cppcheck
cppcheck: ## static analysis; members of structures that are registers are never "used", so without style there
	$(CPPCHECK) --enable=warning,style,performance,portability core boards/host boards/plant boards/script checks/*.c
	$(CPPCHECK) --enable=warning,performance,portability boards/mps2-an386 checks/arm
