/* Inputs of the fuzzer from files, without the fuzzer: for measuring what they cover. */

#include <stdint.h>
#include <stdio.h>

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t n);

int main(int n_files, char *files[])
{
    static uint8_t input[1 << 16];
    for (int i = 1; i < n_files; i++) {
        FILE *file = fopen(files[i], "rb");
        if (!file)
            return 1;
        size_t n = fread(input, 1, sizeof input, file);
        fclose(file);
        LLVMFuzzerTestOneInput(input, n);
    }
    return 0;
}
