/* The loop on the device (tick.c), where the compiled tick is linked in: VL_HAS_TICK. Elsewhere nothing is left of it. */

#ifndef VL_LOOP_H
#define VL_LOOP_H

enum { VL_ROW_BYTES = 32 };   /* of telemetry of a sample, beside its readings */
enum { VL_STATE_BYTES = 1280 }; /* for the state that is told with a block */

#ifdef VL_HAS_TICK
void vl_begin_tick(void);
bool vl_tick_get(uint8_t parameter, uint8_t item, uint32_t *value);
enum vl_status vl_tick_resize(uint8_t place, uint32_t *bytes);
/* Take a piece of an array of the records, while nothing is sampled. False: it does not fit, or belongs to no array. */
bool vl_take_record(uint8_t place, uint32_t offset, const uint8_t *bytes, uint32_t n);
bool vl_tick_is_ready(uint32_t *why_not);
void vl_restart_tick(void);
int32_t vl_tick_output(void); /* count of the last output, 0 before the first sample */
/* A sample: counts of the inputs, NULL if it was lost. False if the compiled code has failed; it must not be called again. */
bool vl_tick(const int32_t counts[], uint16_t flags);
void vl_keep_row(uint8_t *block, uint32_t index); /* the last sample's readings and row, at its place in a block */
uint32_t vl_tick_state(uint8_t *into);            /* at most VL_STATE_BYTES; returns how many, 0 where none is due */
void vl_tick_ramp_locked(void);
void vl_tick_release_locked(void);

/* Whether the loop runs on the device, since the last START. */
static inline bool vl_has_loop(void)
{
    return vl_in_force.loop != 0;
}
#else
static inline void vl_begin_tick(void) {}
static inline bool vl_tick_get(uint8_t parameter, uint8_t item, uint32_t *value)
{
    (void)parameter, (void)item, (void)value;
    return false;
}
static inline enum vl_status vl_tick_resize(uint8_t place, uint32_t *bytes)
{
    (void)place;
    *bytes = 0;
    return VL_UNKNOWN;
}
static inline bool vl_take_record(uint8_t place, uint32_t offset, const uint8_t *bytes, uint32_t n)
{
    (void)place, (void)offset, (void)bytes, (void)n;
    return false;
}
static inline bool vl_tick_is_ready(uint32_t *why_not)
{
    *why_not = 0;
    return false;
}
static inline void vl_restart_tick(void) {}
static inline int32_t vl_tick_output(void)
{
    return 0;
}
static inline bool vl_tick(const int32_t counts[], uint16_t flags)
{
    (void)counts, (void)flags;
    return false;
}
static inline void vl_keep_row(uint8_t *block, uint32_t index)
{
    (void)block, (void)index;
}
static inline uint32_t vl_tick_state(uint8_t *into)
{
    (void)into;
    return 0;
}
static inline void vl_tick_ramp_locked(void) {}
static inline void vl_tick_release_locked(void) {}

static inline bool vl_has_loop(void)
{
    return false;
}
#endif

#endif
