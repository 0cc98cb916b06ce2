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
