# Checks of the core: fuzzing, branch coverage, static analysis.

RUNS ?= 3400000
FUZZER = clang
FUZZ = $(CORE) boards/script/bench.c checks/fuzz.c
FUZZ_LIMITS = -DVL_LARGEST_BLOCK=100 -DVL_MOST_BLOCKS=8
FUZZ_FLAGS = -max_len=256 -print_final_stats=1

.PHONY: fuzz fuzz-serial fuzz-can fuzz-can-fd
fuzz: fuzz-serial fuzz-can fuzz-can-fd ## RUNS=n inputs each by libFuzzer, under sanitizers (three times 3.4 million)
fuzz-serial: $(BUILD)/fuzz-serial ## of these, a serial line
fuzz-can: $(BUILD)/fuzz-can ## of these, classical CAN
fuzz-can-fd: $(BUILD)/fuzz-can-fd ## of these, CAN FD

$(BUILD)/fuzz-serial: WIRE = 0
$(BUILD)/fuzz-can: WIRE = 1
$(BUILD)/fuzz-can-fd: WIRE = 2
$(BUILD)/fuzz-serial $(BUILD)/fuzz-can $(BUILD)/fuzz-can-fd: $(FUZZ) $(HEADERS) | $(BUILD)
	$(FUZZER) $(WARNINGS) -O2 -g -fsanitize=fuzzer,address,undefined -fno-sanitize-coverage=trace-cmp \
	    -fno-sanitize-recover=all -DFUZZ_WIRE=$(WIRE) \
	    $(FUZZ_LIMITS) -Icore $(FUZZ) -o $@

fuzz-serial fuzz-can fuzz-can-fd:
	mkdir -p $(BUILD)/corpus/$@
	$(BUILD)/$@ $(FUZZ_FLAGS) -runs=$(RUNS) -artifact_prefix=$(BUILD)/ $(BUILD)/corpus/$@
