# The device for a NUCLEO-H743ZI2: Cortex-M7 with double precision.

NUCLEO_CC ?= arm-none-eabi-gcc
NUCLEO = boards/nucleo-h743zi2
NUCLEO_ARM = -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16 -ffunction-sections -fdata-sections
# limits for 128 kB of data
NUCLEO_LIMITS = -DVL_MOST_CHANNELS=4 -DVL_LARGEST_BLOCK=100 -DVL_LARGEST_QUEUE=32 -DVL_MOST_COUNT_BYTES=2 -DVL_LONGEST_PERIOD=1024

# With the loop on it, make nucleo-h743zi2 TICK=DIR: records in fast memory, rows in the large one, some 0.8 s of them at 5 kHz.
ifdef TICK
NUCLEO_LOOP = -DVL_HAS_TICK -isystem $(TICK) -DVL_TICK_BYTES=61440 -DVL_SAMPLE_BYTES=196608 -DVL_BULK='__attribute__((section(".bulk")))'
NUCLEO_LOOP_FILES = $(TICK)/tick-cortex-m7.o $(TICK)/vibrolock_tick.h
endif

.PHONY: nucleo-h743zi2 nucleo-h743zi2-can
nucleo-h743zi2: $(BUILD)/nucleo-h743zi2.elf ## the device for a NUCLEO-H743ZI2, over the debugger's serial line
nucleo-h743zi2-can: $(BUILD)/nucleo-h743zi2-can.elf ## the same over CAN FD, as node 1; another: NUCLEO_FLAGS=-DNUCLEO_NODE=2

NUCLEO_SOURCES = $(CORE) $(wildcard $(NUCLEO)/*.c)
NUCLEO_LINK = $(NUCLEO_CC) $(WARNINGS) $(NUCLEO_ARM) -O2 -g $(NUCLEO_LIMITS) $(NUCLEO_LOOP) $(NUCLEO_FLAGS) -Icore $(NUCLEO_SOURCES) \
  $(filter %.o,$(NUCLEO_LOOP_FILES)) -o $@ -nostartfiles \
  --specs=nano.specs --specs=nosys.specs -T $(NUCLEO)/memory.ld -Wl,--gc-sections -lm
NUCLEO_NEEDS = $(NUCLEO_SOURCES) $(HEADERS) $(NUCLEO)/memory.ld $(NUCLEO)/board.mk $(NUCLEO_LOOP_FILES)
$(BUILD)/nucleo-h743zi2.elf: $(NUCLEO_NEEDS) | $(BUILD)
	$(NUCLEO_LINK)
$(BUILD)/nucleo-h743zi2-can.elf: $(NUCLEO_NEEDS) | $(BUILD)
	$(NUCLEO_LINK) -DNUCLEO_CAN
