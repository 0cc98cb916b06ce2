# The core as ARM machine code for the mps2-an386 with a Cortex-M4 in QEMU.

ARM_CC ?= arm-none-eabi-gcc
ARM_OPTIMISATION ?= -O2
ARM = -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -ffunction-sections -fdata-sections # as an STM32G4

# limits for 128 KiB of RAM and 512 KiB of flash
ARM_LIMITS = -DVL_MOST_CHANNELS=8 -DVL_LARGEST_BLOCK=100 -DVL_LARGEST_QUEUE=32
AN386 = boards/mps2-an386

.PHONY: mps2-an386
mps2-an386: $(BUILD)/mps2-an386.elf ## the device as ARM machine code, for QEMU

MPS2_AN386 = $(CORE) $(wildcard $(AN386)/*.c boards/plant/*.c)
$(BUILD)/mps2-an386.elf: $(MPS2_AN386) $(HEADERS) $(AN386)/memory.ld $(AN386)/board.mk | $(BUILD)
	$(ARM_CC) $(WARNINGS) $(ARM) $(ARM_OPTIMISATION) -g $(ARM_LIMITS) -Icore -Iboards/plant -D_POSIX_C_SOURCE=200809L \
	  $(MPS2_AN386) -o $@ -nostartfiles --specs=nano.specs --specs=rdimon.specs -T $(AN386)/memory.ld -Wl,--gc-sections
