/* Numbers of the wire, little-endian, at any place in memory. */

#ifndef VL_BYTES_H
#define VL_BYTES_H

#include <stdint.h>
#include <string.h>

static inline uint32_t vl_u32(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static inline uint64_t vl_u64(const uint8_t *bytes)
{
    return (uint64_t)vl_u32(bytes) | (uint64_t)vl_u32(bytes + 4) << 32;
}

/* A count of 2 or 4 bytes, two's complement. */
static inline int32_t vl_count(const uint8_t *bytes, uint32_t n_bytes)
{
    if (n_bytes == 2) {
        int32_t low = (int32_t)bytes[0] | (int32_t)bytes[1] << 8;
        return low < 0x8000 ? low : low - 0x10000;
    }
    uint32_t word = vl_u32(bytes);
    return word < 0x80000000u ? (int32_t)word : (int32_t)(word - 0x80000000u) - INT32_MAX - 1;
}

static inline uint8_t *vl_put_count(uint8_t *bytes, int32_t count, uint32_t n_bytes)
{
    const uint32_t word = (uint32_t)count;
    bytes[0] = (uint8_t)word;
    bytes[1] = (uint8_t)(word >> 8);
    if (n_bytes == 4) {
        bytes[2] = (uint8_t)(word >> 16);
        bytes[3] = (uint8_t)(word >> 24);
    }
    return bytes + n_bytes;
}

static inline uint8_t *vl_put(uint8_t *bytes, uint64_t value, uint32_t n_bytes)
{
    for (uint32_t i = 0; i < n_bytes; i++)
        *bytes++ = (uint8_t)(value >> (8 * i));
    return bytes;
}

#endif
