# The device for a NUCLEO-H743ZI2: Cortex-M7 with double precision.

NUCLEO_CC ?= arm-none-eabi-gcc
NUCLEO = boards/nucleo-h743zi2
NUCLEO_ARM = -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16 -ffunction-sections -fdata-sections
# limits for 128 kB of data
NUCLEO_LIMITS = -DVL_MOST_CHANNELS=4 -DVL_LARGEST_BLOCK=100 -DVL_LARGEST_QUEUE=32 -DVL_MOST_COUNT_BYTES=2 -DVL_LONGEST_PERIOD=1024

.PHONY: nucleo-h743zi2
nucleo-h743zi2: $(BUILD)/nucleo-h743zi2.elf ## the device for a NUCLEO-H743ZI2

NUCLEO_SOURCES = $(CORE) $(wildcard $(NUCLEO)/*.c)
$(BUILD)/nucleo-h743zi2.elf: $(NUCLEO_SOURCES) $(HEADERS) $(NUCLEO)/memory.ld $(NUCLEO)/board.mk | $(BUILD)
	$(NUCLEO_CC) $(WARNINGS) $(NUCLEO_ARM) -O2 -g $(NUCLEO_LIMITS) $(NUCLEO_FLAGS) -Icore $(NUCLEO_SOURCES) -o $@ -nostartfiles \
	  --specs=nano.specs --specs=nosys.specs -T $(NUCLEO)/memory.ld -Wl,--gc-sections -lm
