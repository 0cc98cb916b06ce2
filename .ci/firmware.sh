# Sourced: what builds and checks the firmware. Where it can be installed, it is, and tests that miss it fail instead of skipping.
firmware_tools="make cc clang arm-none-eabi-gcc qemu-system-arm cppcheck gcovr"
missing_for_firmware() {
    for tool in $firmware_tools; do
        command -v "$tool" > /dev/null || echo "$tool"
    done
    [ -f "$(arm-none-eabi-gcc -print-file-name=rdimon.specs 2> /dev/null)" ] || echo "newlib for ARM"
    echo "int LLVMFuzzerTestOneInput(const char *data, unsigned long n) { return data && !n; }" \
        | clang -fsanitize=fuzzer,address -x c - -o /dev/null 2> /dev/null || echo "libFuzzer"
}
if [ -n "$(missing_for_firmware)" ] && command -v apt-get > /dev/null; then
    as_root=""
    [ "$(id -u)" = 0 ] || as_root="sudo -n"
    packages="make gcc libc6-dev clang libclang-rt-dev gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm cppcheck gcovr"
    echo "+ apt-get install $packages"
    { $as_root apt-get update -q && $as_root apt-get install -q -y --no-install-recommends $packages; } > /dev/null 2>&1 || true
fi
if [ -z "$(missing_for_firmware)" ]; then
    export VIBROLOCK_FIRMWARE=required
else
    echo "no $(missing_for_firmware | paste -sd, | sed 's/,/, no /g'), and none can be installed here: tests of the firmware that need it say that they skip"
fi
