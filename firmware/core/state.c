/* What all parts of the device know: its description, the settings, the count on the converter, the counters. */

#include "device.h"

const struct vl_description *vl_about;
struct vl_counters vl_counters;
struct vl_settings vl_settings, vl_in_force;
uint32_t vl_boot;
int32_t vl_held;

uint32_t vl_count_bytes(void)
{
    return vl_about->bits / 8;
}

uint32_t vl_sample_bytes(const struct vl_settings *settings)
{
    return settings->loop ? vl_row_bytes(settings) : (vl_about->n_channels + 1) * vl_count_bytes();
}

uint32_t vl_row_bytes(const struct vl_settings *settings)
{
    return settings->loop ? vl_about->n_channels * (uint32_t)sizeof(float) + VL_ROW_BYTES : vl_about->n_channels * vl_count_bytes();
}
