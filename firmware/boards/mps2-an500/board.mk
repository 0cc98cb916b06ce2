# The device with the loop on it as ARM machine code for the mps2-an500 with a Cortex-M7 in QEMU: the board of the mps2-an386, with
# the memory of this one. make mps2-an500 TICK=DIR, with the folder that `rig firmware tick --target cortex-m7 -o DIR` has filled.

ARM_M7 = -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16 -ffunction-sections -fdata-sections
ARM_M7_LIMITS = -DVL_MOST_CHANNELS=8 -DVL_LARGEST_BLOCK=100 -DVL_LARGEST_QUEUE=32 -DVL_SAMPLE_BYTES=196608 -DUART_RING=65536u
AN500 = boards/mps2-an500

.PHONY: mps2-an500
mps2-an500: $(BUILD)/mps2-an500.elf ## TICK=DIR: the device that runs the loop, as ARM machine code, for QEMU

MPS2_AN500 = $(CORE) $(wildcard $(AN386)/*.c boards/plant/*.c)
$(BUILD)/mps2-an500.elf: $(MPS2_AN500) $(HEADERS) $(AN500)/memory.ld $(AN500)/board.mk $(TICK)/tick-cortex-m7.o | $(BUILD)
	$(ARM_CC) $(WARNINGS) $(ARM_M7) $(ARM_OPTIMISATION) -g $(ARM_M7_LIMITS) -DVL_HAS_TICK -isystem $(TICK) -Icore -Iboards/plant -I$(AN386) \
	  -D_POSIX_C_SOURCE=200809L $(MPS2_AN500) $(TICK)/tick-cortex-m7.o -o $@ -nostartfiles --specs=nano.specs --specs=rdimon.specs \
	  -T $(AN500)/memory.ld -Wl,--gc-sections -Wl,--no-warn-execstack -lm
